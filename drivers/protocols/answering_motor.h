#pragma once

#include <cstdint>
#include <limits>
#include <string_view>
#include <utility>

#include "drivers/protocols/motor.h"

namespace plumb {

/// The host's side of a drive that speaks only when spoken to: its answers show that it is there,
/// and that it has stopped. What such protocols have in common, whatever their frames: steps from
/// rest through arming to armed and through disarming back to rest, silence, faults, repetitions.
///
/// It begins by disarming: whoever was here before us may have left the drive running. Disarming
/// ends when an answer to the second order to stop has come, for the first one may be the answer to
/// an earlier command.
/// @tparam Step kRest, the steps of arming, kArmed and kDisarming; scoped, each once.
/// Not thread-safe.
template <class Step>
class AnsweringMotor : public Motor {
 public:
  void Arm(int64_t now) noexcept final {
    if (step_ == Step::kArmed) return;
    fault_ = false;
    reason_.Clear();
    BeginArming(now);
  }

  void Disarm(int64_t now) noexcept final { Enter(Step::kDisarming, now); }

  // None of these protocols has an emergency stop but this.
  void Estop(int64_t now) noexcept final {
    Fail(now, "emergency stop requested");
    Disarm(now);
  }

  void Transmitted(bool all, int64_t now) noexcept final {
    if (!std::exchange(given_, false)) return;
    if (!all) {
      retry_ = now;
      return;
    }
    ++sent_;
    if (step_ == Step::kDisarming && sent_ <= kStops) ForgetAnswers();
    OnSent(now);
  }

  bool lost_place() const noexcept final { return lost_place_; }
  void Homed() noexcept final { lost_place_ = false; }
  void Displaced() noexcept override { lost_place_ = false; }
  int64_t saturations() const noexcept final { return saturations_; }

  DriveState state() const noexcept final {
    if (!present_) return DriveState::kAbsent;
    if (fault_) return DriveState::kFault;
    if (step_ == Step::kArmed) return DriveState::kArmed;
    return Active() ? DriveState::kArming : DriveState::kIdle;
  }
  std::string_view reason() const noexcept final {
    if (reason_.text().empty() && !present_) return heard_ ? "no answer any more" : "no answer yet";
    return reason_.text();
  }
  bool confirmed_idle() const noexcept final {
    return step_ == Step::kRest || (!present_ && !may_run_);
  }

 protected:
  static constexpr int64_t kRetry = 20'000;  ///< [us] much longer than an answer takes

  explicit AnsweringMotor(const MotorTiming& timing)
      : heartbeat_timeout_(timing.heartbeat_timeout) {}

  /// Enters the first step of arming, with whatever has to be known anew forgotten.
  virtual void BeginArming(int64_t now) noexcept = 0;
  /// Answers until now count for no step.
  virtual void ForgetAnswers() noexcept = 0;
  /// What the last Tick gave has been accepted, for the sent()-th time in this step.
  virtual void OnSent(int64_t) noexcept {}

  Step step() const noexcept { return step_; }
  /// Arming or armed: the driver asks for setpoints, be they zero.
  bool Active() const noexcept { return step_ != Step::kRest && step_ != Step::kDisarming; }
  bool heard() const noexcept { return heard_; }      ///< ever
  bool present() const noexcept { return present_; }  ///< lately
  int64_t answered() const noexcept { return answered_; }
  int64_t heartbeat_timeout() const noexcept { return heartbeat_timeout_; }
  /// In this step: Ticks with orders that have been accepted.
  int sent() const noexcept { return sent_; }

  void Enter(Step step, int64_t now) noexcept {
    step_ = step;
    entered_ = retry_ = now;
    sent_ = 0;
    ForgetAnswers();
  }
  /// The drive has confirmed that it does not run.
  void Rest(int64_t now) noexcept {
    may_run_ = false;
    Enter(Step::kRest, now);
  }
  /// Whether an order to stop that is not the first has been answered.
  bool Stopped(int answers) const noexcept { return sent_ >= kStops && answers > 0; }

  /// The drive has spoken. @param at [us] when it did, as far as its next silence is concerned.
  void Hear(int64_t at) noexcept {
    heard_ = present_ = true;
    answered_ = at;
  }
  /// Each Tick begins with it. @param silence [us] that an active drive may not reach.
  void Watch(int64_t now, int64_t silence) noexcept {
    present_ = heard_ && now - answered_ <= heartbeat_timeout_;
    if (Active() && heard_ && now - answered_ >= silence) FailSilent(now);
  }
  /// Each Tick tells whether it gave orders, which Transmitted is about.
  void Give(bool orders) noexcept { given_ = orders; }
  /// It is told to run with what is sent now.
  void MayRun() noexcept { may_run_ = true; }

  /// The step has taken too long.
  bool Late(int64_t now) const noexcept { return now - entered_ >= heartbeat_timeout_; }
  int64_t Since(int64_t now) const noexcept { return (now - entered_) / 1000; }  ///< [ms]
  bool Retry(int64_t now, int64_t period = kRetry) noexcept {
    if (now < retry_) return false;
    retry_ = now + period;
    return true;
  }

  template <class... Args>
  void Fail(int64_t now, fmt::format_string<Args...> format, Args&&... args) noexcept {
    reason_.Set(format, std::forward<Args>(args)...);
    fault_ = true;
    // To begin anew with every fault would never come to an end where faults keep coming.
    if (Active()) Disarm(now);
  }
  void FailSilent(int64_t now) noexcept {
    Fail(now, "no answer for {} ms", (now - answered_) / 1000);
  }
  /// It counts its turns from elsewhere: a person has to home the joint.
  void LosePlace() noexcept { lost_place_ = true; }
  /// A setpoint could not be said as it was.
  void CountSaturation() noexcept { ++saturations_; }

 private:
  static constexpr int kStops = 2;

  const int64_t heartbeat_timeout_;
  bool heard_ = false, present_ = false;
  int64_t answered_ = 0;
  int64_t saturations_ = 0;

  Step step_ = Step::kDisarming;
  int64_t entered_ = 0, retry_ = std::numeric_limits<int64_t>::min();
  int sent_ = 0;
  bool given_ = false;    // the last Tick gave orders
  bool may_run_ = false;  // told to run, and not known to have stopped since
  bool fault_ = false;
  bool lost_place_ = false;
  Reason reason_;
};

}  // namespace plumb
