#pragma once

#include <cstdint>
#include <utility>

#include "drivers/protocols/stepped_motor.h"

namespace plumb {

/// The host's side of a drive that speaks only when spoken to: its answers show that it is there,
/// and that it has stopped. It begins by disarming: whoever was here before us may have left the
/// drive running.
/// @tparam Step as SteppedMotor's. Not thread-safe.
template <class Step>
class AnsweringMotor : public SteppedMotor<Step> {
  using Base = SteppedMotor<Step>;

 public:
  void Disarm(int64_t now) noexcept final { Base::Enter(Step::kDisarming, now); }

  // None of these protocols has an emergency stop but this.
  void Estop(int64_t now) noexcept final {
    Fail(now, "emergency stop requested");
    Disarm(now);
  }

 protected:
  static constexpr int64_t kRetry = 20'000;  ///< [us] much longer than an answer takes

  explicit AnsweringMotor(const MotorTiming& timing)
      : Base(Step::kDisarming, timing, {"no answer yet", "no answer any more"}) {}

  /// Each Tick begins with it. @param silence [us] that an active drive may not reach.
  void Watch(int64_t now, int64_t silence) noexcept {
    Base::NotePresence(now);
    if (Base::Active() && Base::heard() && now - Base::answered() >= silence) FailSilent(now);
  }

  template <class... Args>
  void Fail(int64_t now, fmt::format_string<Args...> format, Args&&... args) noexcept {
    Base::Explain(format, std::forward<Args>(args)...);
    Base::SetFault();
    // To begin anew with every fault would never come to an end where faults keep coming.
    if (Base::Active()) Disarm(now);
  }
  void FailSilent(int64_t now) noexcept { Fail(now, "no answer for {} ms", Base::SilentFor(now)); }
};

}  // namespace plumb
