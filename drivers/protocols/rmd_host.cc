#include "drivers/protocols/rmd_host.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#include "common/time_units.h"
#include "drivers/protocols/answering_motor.h"
#include "drivers/protocols/rmd.h"
#include "drivers/protocols/rmd_reports.h"

namespace plumb {
namespace {

using namespace rmd;

constexpr int64_t kRemind = 100'000;  // [us] between orders to stop, to one at rest
constexpr int kAnswersToArm = 2;
constexpr Code kPolled[] = {kAskStatus, kAskUptime, kAskVersion, kAskModel};

enum class Step { kRest, kSettle, kRelease, kAwait, kArmed, kDisarming };

class RmdMotor : public AnsweringMotor<Step> {
 public:
  RmdMotor(int node, const RmdDescription& settings, const MotorTiming& timing)
      : AnsweringMotor(timing),
        node_(node),
        torque_constant_(settings.torque_constant),
        // in whole codes, so that none is beyond
        most_current_(std::floor(settings.current / kTorque.fields[1].scale + 1e-9) *
                      kTorque.fields[1].scale),
        watchdog_(Microseconds(settings.watchdog)),
        reports_(settings.torque_constant) {}

  Filter filter() const override { return {.id = kAnswers + static_cast<uint32_t>(node_)}; }

  FrameUse OnFrame(const Frame& frame, int64_t now) noexcept override {
    if (frame.extended || frame.remote || frame.error || frame.fd || frame.id != filter().id)
      return FrameUse::kNotMine;
    if (frame.length != 8) return FrameUse::kRejected;
    if (frame.data[0] == kInterrupted) {
      // Its next answer is an echo.
      Hear(now - watchdog_);
      if (Active()) Fail(now, "its watchdog has expired: no frame for {} ms", watchdog_ / 1000);
      return FrameUse::kConsumed;
    }
    if (!IsAnswer(frame.data[0])) return FrameUse::kRejected;
    const bool echo = !heard() || now - answered() >= watchdog_;
    if (echo && step() == Step::kArmed) FailSilent(now);
    Hear(now);
    return echo ? FrameUse::kConsumed : OnAnswer(frame, now);
  }

  const MotorEstimate& estimate() const noexcept override { return reports_.estimate(); }
  double torque_estimate() const noexcept override { return reports_.torque_estimate(); }
  MotorReadings readings() const noexcept override { return reports_.readings(); }
  std::string_view identity() const noexcept override { return reports_.identity(); }

  bool IsEstop(const Frame& frame) const noexcept override {
    if (frame.extended || frame.remote || frame.length == 0 ||
        (frame.id != kCommands + static_cast<uint32_t>(node_) && frame.id != kAllMotors)) {
      return false;
    }
    const uint8_t code = frame.data[0];
    return code == kShutdown || code == kStop || code == kLockBrake || code == kReset;
  }

  void Tick(int64_t now, bool may_arm, FrameBatch& out) noexcept override {
    // A brake takes its time, and keeps a motor that is being armed from answering.
    Watch(now, step() == Step::kArmed ? watchdog_ : heartbeat_timeout());
    const size_t before = out.size();
    PushOrders(now, may_arm, out);
    Give(out.size() > before);
    PushQuestions(now, out);
  }

  Frame Torque(double torque) noexcept override {
    if (step() != Step::kArmed) torque = 0;
    double current = torque / torque_constant_;
    // Less than a code is lost in rounding, not to the range.
    if (!(std::abs(current) < most_current_ + kTorque.fields[1].scale)) CountSaturation();
    if (!std::isfinite(current)) current = 0;
    return MakeCommand(kTorque, node_, std::clamp(current, -most_current_, most_current_));
  }

  int num_polled() const noexcept override { return static_cast<int>(std::size(kPolled)); }
  void Poll(FrameBatch& out) noexcept override {
    out.Push(MakeCommand(kPolled[poll_turn_], node_));
    poll_turn_ = (poll_turn_ + 1) % std::size(kPolled);
  }

 private:
  void BeginArming(int64_t now) noexcept override {
    MayRun();  // from the driver's zero setpoints on
    status_known_ = brake_released_ = false;
    Enter(Step::kSettle, now);
  }

  void ForgetAnswers() noexcept override { shutdowns_ = setpoints_ = 0; }

  static bool IsAnswer(uint8_t code) noexcept {
    constexpr Code kKnown[] = {kReleaseBrake, kLockBrake, kShutdown,     kAskAngle,
                               kAskStatus,    kAskMotion, kAskUptime,    kAskVersion,
                               kSetWatchdog,  kAskModel,  kTorqueControl};
    return std::ranges::find(kKnown, code) != std::end(kKnown);
  }

  void PushOrders(int64_t now, bool may_arm, FrameBatch& out) noexcept {
    if (step() == Step::kSettle && watchdog_set_ && status_known_) Enter(Step::kRelease, now);
    if (step() == Step::kRelease && brake_released_) Enter(Step::kAwait, now);
    if (step() == Step::kAwait && setpoints_ >= kAnswersToArm) Enter(Step::kArmed, now);
    if (step() == Step::kDisarming && Stopped(shutdowns_)) Rest(now);
    if (Late(now)) GiveUpArming(now);
    switch (step()) {
      case Step::kRest:
      case Step::kDisarming:
        if (!Retry(now, step() == Step::kRest && present() ? kRemind : kRetry)) return;
        out.Push(MakeCommand(kShutdown, node_));
        out.Push(MakeCommand(kLockBrake, node_));
        return;
      case Step::kSettle:
        if (!may_arm || !Retry(now, kRetry)) return;
        if (!watchdog_set_) {
          const int64_t milliseconds = watchdog_ / 1000;  // whole ones
          out.Push(MakeCommand(kWatchdog, node_, static_cast<double>(milliseconds)));
        }
        out.Push(MakeCommand(kAskStatus, node_));
        return;
      case Step::kRelease:
        if (may_arm && Retry(now, kRetry)) out.Push(MakeCommand(kReleaseBrake, node_));
        return;
      case Step::kAwait:
      case Step::kArmed:
        return;
    }
  }

  void GiveUpArming(int64_t now) noexcept {
    if ((step() == Step::kSettle || step() == Step::kRelease) && sent() == 0) {
      Fail(now, "the bus has not taken its arming frames for {} ms", Since(now));
    } else if (step() == Step::kSettle) {
      Fail(now, "it does not answer (ids {:#05x} and {:#05x})",
           kCommands + static_cast<uint32_t>(node_), filter().id);
    } else if (step() == Step::kRelease) {
      Fail(now, "it does not answer that its brake is to be released");
    } else if (step() == Step::kAwait) {
      Fail(now, "it does not answer setpoints");
    }
  }

  // Behind the orders: what a motor ignores after a silence shall not be what counts.
  void PushQuestions(int64_t now, FrameBatch& out) noexcept {
    if (!present() && now < ask_) return;
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
        watchdog_set_ = watchdog_set_ || (step() == Step::kSettle && sent() > 0);
        break;
      case kReleaseBrake:
        brake_released_ = step() == Step::kRelease && sent() > 0;
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
      LosePlace();
      watchdog_set_ = false;  // it may be another motor
      if (Active()) Fail(now, "it has restarted {} ms ago", *uptime);
    }
    return use;
  }

  const int node_;
  const double torque_constant_, most_current_;
  const int64_t watchdog_;

  RmdReports reports_;
  size_t poll_turn_ = 0;
  int64_t ask_ = std::numeric_limits<int64_t>::min();
  int shutdowns_ = 0, setpoints_ = 0;  // in this step: answered
  bool watchdog_set_ = false;
  bool status_known_ = false, brake_released_ = false;  // since Arm
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
