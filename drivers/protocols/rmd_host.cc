#include "drivers/protocols/rmd_host.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "common/time_units.h"
#include "drivers/protocols/rmd.h"
#include "drivers/protocols/rmd_reports.h"

namespace plumb {
namespace {

using namespace rmd;

constexpr int64_t kRetry = 20'000;    // [us] between repetitions; much longer than an answer takes
constexpr int64_t kRemind = 100'000;  // [us] between orders to stop, to one at rest
constexpr int kShutdowns = 2;         // the first answer may be one to an earlier command
constexpr int kAnswersToArm = 2;
constexpr Code kPolled[] = {kAskStatus, kAskUptime, kAskVersion, kAskModel};

class RmdMotor : public Motor {
 public:
  RmdMotor(int node, const RmdDescription& settings, const MotorTiming& timing)
      : node_(node),
        torque_constant_(settings.torque_constant),
        // in whole codes, so that none is beyond
        most_current_(std::floor(settings.current / kTorque.fields[1].scale + 1e-9) *
                      kTorque.fields[1].scale),
        watchdog_(Microseconds(settings.watchdog)),
        timing_(timing),
        reports_(settings.torque_constant) {}

  Filter filter() const override { return {.id = kAnswers + static_cast<uint32_t>(node_)}; }

  FrameUse OnFrame(const Frame& frame, int64_t now) noexcept override {
    if (frame.extended || frame.remote || frame.error || frame.fd || frame.id != filter().id)
      return FrameUse::kNotMine;
    if (frame.length != 8) return FrameUse::kRejected;
    if (frame.data[0] == kInterrupted) {
      // Its next answer is an echo.
      answered_ = now - watchdog_;
      heard_ = present_ = true;
      if (Active()) Fail(now, "its watchdog has expired: no frame for {} ms", watchdog_ / 1000);
      return FrameUse::kConsumed;
    }
    if (!IsAnswer(frame.data[0])) return FrameUse::kRejected;
    const bool echo = !heard_ || now - answered_ >= watchdog_;
    if (echo && step_ == Step::kArmed) FailSilent(now);
    heard_ = present_ = true;
    answered_ = now;
    return echo ? FrameUse::kConsumed : OnAnswer(frame, now);
  }

  const MotorEstimate& estimate() const noexcept override { return reports_.estimate(); }
  double torque_estimate() const noexcept override { return reports_.torque_estimate(); }
  MotorReadings readings() const noexcept override { return reports_.readings(); }
  std::string_view identity() const noexcept override { return reports_.identity(); }
  int64_t saturations() const noexcept override { return saturations_; }

  void Arm(int64_t now) noexcept override {
    if (step_ == Step::kArmed) return;
    fault_ = false;
    reason_.Clear();
    may_run_ = true;  // from the driver's zero setpoints on
    status_known_ = brake_released_ = false;
    Enter(Step::kSettle, now);
  }

  void Disarm(int64_t now) noexcept override { Enter(Step::kDisarming, now); }

  // The protocol has no emergency stop but this.
  void Estop(int64_t now) noexcept override {
    Fail(now, "emergency stop requested");
    Disarm(now);
  }

  bool IsEstop(const Frame& frame) const noexcept override {
    if (frame.extended || frame.remote || frame.length == 0 ||
        (frame.id != kCommands + static_cast<uint32_t>(node_) && frame.id != kAllMotors)) {
      return false;
    }
    const uint8_t code = frame.data[0];
    return code == kShutdown || code == kStop || code == kLockBrake || code == kReset;
  }

  void Tick(int64_t now, bool may_arm, FrameBatch& out) noexcept override {
    present_ = heard_ && now - answered_ <= timing_.heartbeat_timeout;
    // A brake takes its time, and keeps a motor that is being armed from answering.
    const int64_t silence = step_ == Step::kArmed ? watchdog_ : timing_.heartbeat_timeout;
    if (Active() && heard_ && now - answered_ >= silence) FailSilent(now);
    const size_t before = out.size();
    PushOrders(now, may_arm, out);
    ordered_ = out.size() > before;
    PushQuestions(now, out);
  }

  void Transmitted(bool all, int64_t now) noexcept override {
    if (!std::exchange(ordered_, false)) return;
    if (!all) {
      retry_ = now;
      return;
    }
    ++sent_;
    if (step_ == Step::kDisarming && sent_ <= kShutdowns) shutdowns_ = 0;
  }

  Frame Torque(double torque) noexcept override {
    if (step_ != Step::kArmed) torque = 0;
    double current = torque / torque_constant_;
    if (!(std::abs(current) <= most_current_)) ++saturations_;
    if (!std::isfinite(current)) current = 0;
    return MakeCommand(kTorque, node_, std::clamp(current, -most_current_, most_current_));
  }

  int num_polled() const noexcept override { return static_cast<int>(std::size(kPolled)); }
  void Poll(FrameBatch& out) noexcept override {
    out.Push(MakeCommand(kPolled[poll_turn_], node_));
    poll_turn_ = (poll_turn_ + 1) % std::size(kPolled);
  }

  bool lost_place() const noexcept override { return lost_place_; }
  void Homed() noexcept override { lost_place_ = false; }
  void Displaced() noexcept override { lost_place_ = false; }

  DriveState state() const noexcept override {
    if (!present_) return DriveState::kAbsent;
    if (fault_) return DriveState::kFault;
    if (step_ == Step::kArmed) return DriveState::kArmed;
    return Active() ? DriveState::kArming : DriveState::kIdle;
  }
  std::string_view reason() const noexcept override {
    if (reason_.text().empty() && !present_) return heard_ ? "no answer any more" : "no answer yet";
    return reason_.text();
  }
  bool confirmed_idle() const noexcept override {
    return step_ == Step::kRest || (!present_ && !may_run_);
  }

 private:
  enum class Step { kRest, kSettle, kRelease, kAwait, kArmed, kDisarming };

  /// Setpoints may be sent, be they zero.
  bool Active() const noexcept { return step_ != Step::kRest && step_ != Step::kDisarming; }

  static bool IsAnswer(uint8_t code) noexcept {
    constexpr Code kKnown[] = {kReleaseBrake, kLockBrake, kShutdown,     kAskAngle,
                               kAskStatus,    kAskMotion, kAskUptime,    kAskVersion,
                               kSetWatchdog,  kAskModel,  kTorqueControl};
    return std::ranges::find(kKnown, code) != std::end(kKnown);
  }

  void Enter(Step step, int64_t now) noexcept {
    step_ = step;
    entered_ = retry_ = now;
    sent_ = shutdowns_ = setpoints_ = 0;
  }

  bool Retry(int64_t now, int64_t period = kRetry) noexcept {
    if (now < retry_) return false;
    retry_ = now + period;
    return true;
  }

  template <class... Args>
  void Fail(int64_t now, fmt::format_string<Args...> format, Args&&... args) noexcept {
    reason_.Set(format, std::forward<Args>(args)...);
    fault_ = true;
    Disarm(now);
  }

  void FailSilent(int64_t now) noexcept {
    Fail(now, "no answer for {} ms", (now - answered_) / 1000);
  }

  void PushOrders(int64_t now, bool may_arm, FrameBatch& out) noexcept {
    if (step_ == Step::kSettle && watchdog_set_ && status_known_) Enter(Step::kRelease, now);
    if (step_ == Step::kRelease && brake_released_) Enter(Step::kAwait, now);
    if (step_ == Step::kAwait && setpoints_ >= kAnswersToArm) Enter(Step::kArmed, now);
    if (step_ == Step::kDisarming && sent_ >= kShutdowns && shutdowns_ > 0) {
      may_run_ = false;
      Enter(Step::kRest, now);
    }
    if (now - entered_ >= timing_.heartbeat_timeout) GiveUpArming(now);
    switch (step_) {
      case Step::kRest:
      case Step::kDisarming:
        if (!Retry(now, step_ == Step::kRest && present_ ? kRemind : kRetry)) return;
        out.Push(MakeCommand(kShutdown, node_));
        out.Push(MakeCommand(kLockBrake, node_));
        return;
      case Step::kSettle:
        if (!may_arm || !Retry(now)) return;
        if (!watchdog_set_)
          out.Push(MakeCommand(kWatchdog, node_, static_cast<double>(watchdog_ / 1000)));
        out.Push(MakeCommand(kAskStatus, node_));
        return;
      case Step::kRelease:
        if (may_arm && Retry(now)) out.Push(MakeCommand(kReleaseBrake, node_));
        return;
      case Step::kAwait:
      case Step::kArmed:
        return;
    }
  }

  void GiveUpArming(int64_t now) noexcept {
    const int64_t late = (now - entered_) / 1000;
    if ((step_ == Step::kSettle || step_ == Step::kRelease) && sent_ == 0) {
      Fail(now, "the bus has not taken its arming frames for {} ms", late);
    } else if (step_ == Step::kSettle) {
      Fail(now, "it does not answer (ids {:#05x} and {:#05x})",
           kCommands + static_cast<uint32_t>(node_), filter().id);
    } else if (step_ == Step::kRelease) {
      Fail(now, "it does not answer that its brake is to be released");
    } else if (step_ == Step::kAwait) {
      Fail(now, "it does not answer setpoints");
    }
  }

  // Behind the orders: what a motor ignores after a silence shall not be what counts.
  void PushQuestions(int64_t now, FrameBatch& out) noexcept {
    if (!present_ && now < ask_) return;
    ask_ = now + kRetry;
    if (!Active()) out.Push(MakeCommand(kAskMotion, node_));
    out.Push(MakeCommand(kAskAngle, node_));
  }

  FrameUse OnAnswer(const Frame& frame, int64_t now) noexcept {
    const FrameUse use = reports_.OnAnswer(frame, now);
    switch (frame.data[0]) {
      case kTorqueControl:
        ++setpoints_;
        break;
      case kShutdown:
        ++shutdowns_;
        break;
      case kSetWatchdog:
        watchdog_set_ = watchdog_set_ || (step_ == Step::kSettle && sent_ > 0);
        break;
      case kReleaseBrake:
        brake_released_ = step_ == Step::kRelease && sent_ > 0;
        break;
      case kAskStatus:
        status_known_ = true;
        if (reports_.errors() != 0 && Active()) {
          std::array<char, 200> words;
          Fail(now, "the motor reports {} ({:#06x})", DescribeErrors(reports_.errors(), words),
               reports_.errors());
        }
        break;
      default:
        break;
    }
    if (const auto uptime = reports_.TakeRestart()) {
      lost_place_ = true;
      watchdog_set_ = false;  // it may be another motor
      if (Active()) Fail(now, "it has restarted {} ms ago", *uptime);
    }
    return use;
  }

  const int node_;
  const double torque_constant_, most_current_;
  const int64_t watchdog_;
  const MotorTiming timing_;

  RmdReports reports_;
  bool heard_ = false, present_ = false;  // ever, lately
  int64_t answered_ = 0;                  // time of the last answer
  int64_t saturations_ = 0;
  size_t poll_turn_ = 0;

  // Whoever was here before us may have left it running.
  Step step_ = Step::kDisarming;
  int64_t entered_ = 0, retry_ = std::numeric_limits<int64_t>::min();
  int64_t ask_ = std::numeric_limits<int64_t>::min();
  int sent_ = 0;                       // in this step: orders accepted
  int shutdowns_ = 0, setpoints_ = 0;  // in this step: answered
  bool ordered_ = false;               // the last Tick gave orders
  bool may_run_ = false;               // may have had setpoints, and is not known to have stopped
  bool watchdog_set_ = false;
  bool status_known_ = false, brake_released_ = false;  // since Arm
  bool fault_ = false;
  bool lost_place_ = false;
  Reason reason_;
};

}  // namespace

std::unique_ptr<Motor> MakeRmdMotor(const MotorDescription& description,
                                    const MotorTiming& timing) {
  if (!description.rmd) throw std::invalid_argument("an RMD motor needs its torque constant");
  const RmdDescription& rmd = *description.rmd;
  if (description.node < 1 || description.node > kMaxNode) {
    throw std::invalid_argument(
        fmt::format("RMD motor id {} is not in [1, {}]", description.node, kMaxNode));
  }
  const auto positive = [](double value) { return value > 0 && std::isfinite(value); };
  if (!positive(rmd.torque_constant) || !positive(rmd.current) || !positive(rmd.watchdog)) {
    throw std::invalid_argument(
        "an RMD motor's torque constant, current and watchdog must be positive");
  }
  return std::make_unique<RmdMotor>(description.node, rmd, timing);
}

}  // namespace plumb
