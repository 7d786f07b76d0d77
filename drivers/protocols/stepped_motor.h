#pragma once

#include <cstdint>
#include <limits>
#include <string_view>
#include <utility>

#include "drivers/protocols/motor.h"

namespace plumb {

/// The host's side of a drive as steps: from rest through arming to armed, and through disarming
/// back to rest. What all protocols have in common: no step follows one that did not happen, what
/// the drive said before a step proves nothing about it, and a drive that was told to run is not
/// idle until it has said so.
/// @tparam Step kRest, the steps of arming, kArmed and kDisarming; scoped, each once.
/// Not thread-safe.
template <class Step>
class SteppedMotor : public Motor {
 public:
  void Arm(int64_t now) noexcept final {
    if (step_ == Step::kArmed) return;
    fault_ = false;
    reason_.Clear();
    BeginArming(now);
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
    if (reason_.text().empty() && !present_) return heard_ ? silence_.any_more : silence_.yet;
    return reason_.text();
  }
  bool confirmed_idle() const noexcept override {
    return step_ == Step::kRest || (!present_ && !may_run_);
  }

 protected:
  /// The reasons of an absent drive: of one that has not spoken yet, and of one that does not any
  /// more.
  struct Silence {
    std::string_view yet, any_more;
  };

  /// @param first what it does until it is first armed, kRest or kDisarming.
  SteppedMotor(Step first, const MotorTiming& timing, Silence silence)
      : heartbeat_timeout_(timing.heartbeat_timeout), silence_(silence), step_(first) {}

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
  bool faulty() const noexcept { return fault_; }     ///< since it was armed last
  int64_t answered() const noexcept { return answered_; }
  int64_t heartbeat_timeout() const noexcept { return heartbeat_timeout_; }
  /// In this step: Ticks with orders that have been accepted.
  int sent() const noexcept { return sent_; }
  /// Whether an order to stop that is not the first has been answered: an answer after the first
  /// may be one to an earlier command. @param answers since the drive was told to stop, as
  /// ForgetAnswers counts them.
  bool Stopped(int answers) const noexcept { return sent_ >= kStops && answers > 0; }

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

  /// The drive has spoken. @param at [us] when it did, as far as its next silence is concerned.
  void Hear(int64_t at) noexcept {
    heard_ = present_ = true;
    answered_ = at;
  }
  /// Each Tick begins with it.
  void NotePresence(int64_t now) noexcept {
    present_ = heard_ && now - answered_ <= heartbeat_timeout_;
  }
  /// Each Tick tells whether it gave orders, which Transmitted is about.
  void Give(bool orders) noexcept { given_ = orders; }
  /// It is told to run with what is sent now, or says that it does.
  void MayRun() noexcept { may_run_ = true; }
  bool may_run() const noexcept { return may_run_; }

  /// The step has taken too long.
  bool Late(int64_t now) const noexcept { return now - entered_ >= heartbeat_timeout_; }
  int64_t Since(int64_t now) const noexcept { return (now - entered_) / 1000; }       ///< [ms]
  int64_t SilentFor(int64_t now) const noexcept { return (now - answered_) / 1000; }  ///< [ms]
  /// @param period [us] between repetitions of an unanswered order.
  bool Retry(int64_t now, int64_t period) noexcept {
    if (now < retry_) return false;
    retry_ = now + period;
    return true;
  }

  template <class... Args>
  void Explain(fmt::format_string<Args...> format, Args&&... args) noexcept {
    reason_.Set(format, std::forward<Args>(args)...);
  }
  /// It stays in fault until it is armed anew. To stop it is the caller's.
  void SetFault() noexcept { fault_ = true; }
  /// It counts its turns from elsewhere: a person has to home the joint.
  void LosePlace() noexcept { lost_place_ = true; }
  /// A setpoint could not be said as it was.
  void CountSaturation() noexcept { ++saturations_; }

 private:
  static constexpr int kStops = 2;

  const int64_t heartbeat_timeout_;
  const Silence silence_;
  bool heard_ = false, present_ = false;
  int64_t answered_ = 0;
  int64_t saturations_ = 0;

  Step step_;
  int64_t entered_ = 0, retry_ = std::numeric_limits<int64_t>::min();
  int sent_ = 0;
  bool given_ = false;    // the last Tick gave orders
  bool may_run_ = false;  // told to run, or heard running, and not known to have stopped since
  bool fault_ = false;
  bool lost_place_ = false;
  Reason reason_;
};

}  // namespace plumb
