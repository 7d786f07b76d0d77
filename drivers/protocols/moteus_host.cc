#include "drivers/protocols/moteus_host.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "common/time_units.h"
#include "drivers/protocols/moteus.h"
#include "drivers/protocols/moteus_reports.h"

namespace plumb {
namespace {

using namespace moteus;

constexpr int64_t kRetry = 20'000;  // [us] between questions to one that is silent
constexpr int kStops = 2;           // the first answer may be one to an earlier command
constexpr int kAnswersToArm = 2;

// Behind "stop", while arming, in turn.
constexpr std::array<uint8_t, 3 + kAskTimeoutMode.size()> kSettingQuestion = [] {
  std::array<uint8_t, 3 + kAskTimeoutMode.size()> bytes{kToMotor, 1, kAskTimeoutMode.size()};
  std::ranges::copy(kAskTimeoutMode, bytes.begin() + 3);
  return bytes;
}();
constexpr std::array<uint8_t, 3> kTextQuestion = {kAskText, 1, 48};
constexpr std::span<const uint8_t> kArmingQuestions[] = {kQuestion, kVersionQuestion,
                                                         kSettingQuestion, kTextQuestion};

class MoteusMotor : public Motor {
 public:
  MoteusMotor(int node, const MoteusDescription& settings, const MotorTiming& timing)
      : node_(node),
        most_(settings.torque),
        watchdog_(Microseconds(settings.watchdog)),
        timing_(timing) {}

  Filter filter() const override {
    const uint32_t id = AnswerId(node_);
    const bool extended = id > 0x7FF;
    return {.id = id, .mask = extended ? Filter::kAllExtended : 0x7FF, .extended = extended};
  }

  FrameUse OnFrame(const Frame& frame, int64_t now) noexcept override {
    const uint32_t id = AnswerId(node_);
    if (frame.remote || frame.error || !frame.fd || frame.id != id ||
        frame.extended != (id > 0x7FF)) {
      return FrameUse::kNotMine;
    }
    const int64_t answers = reports_.answers();
    const FrameUse use = reports_.OnFrame(frame, now);
    if (use == FrameUse::kRejected) {
      ++misfits_;
      return use;
    }
    if (step_ == Step::kArmed && now - answered_ >= watchdog_) FailSilent(now);
    heard_ = present_ = true;
    answered_ = now;
    if (reports_.answers() != answers) OnMode(now);
    return use;
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
    misfits_ = 0;
    reports_.ForgetSettings();
    Enter(Step::kSettle, now);
  }

  void Disarm(int64_t now) noexcept override { Enter(Step::kDisarming, now); }

  // The protocol has no emergency stop but this.
  void Estop(int64_t now) noexcept override {
    Fail(now, "emergency stop requested");
    Disarm(now);
  }

  bool IsEstop(const Frame& frame) const noexcept override {
    const uint32_t to = frame.id & 0xFF;
    return !frame.remote && frame.length >= 3 &&
           (to == static_cast<uint32_t>(node_) || to == kEverybody) && frame.id <= 0xFFFF &&
           frame.data[0] == (kWrite | kInt8 | 1) && frame.data[1] == kMode &&
           frame.data[2] == kStopped;
  }

  void Tick(int64_t now, bool, FrameBatch& out) noexcept override {
    present_ = heard_ && now - answered_ <= timing_.heartbeat_timeout;
    // Text and numbers take it no longer than a setpoint does.
    const int64_t silence = step_ == Step::kArmed ? watchdog_ : timing_.heartbeat_timeout;
    if (Active() && heard_ && now - answered_ >= silence) FailSilent(now);
    if (Active() && step_ != Step::kArmed && now - entered_ >= timing_.heartbeat_timeout)
      GiveUpArming(now);
    given_ = false;
    if (Active() || (!present_ && !Retry(now))) return;
    out.Push(step_ == Step::kRest ? MakeFrame(CommandId(node_), {kQuestion}) : MakeStop(node_));
    given_ = true;
  }

  void Transmitted(bool all, int64_t now) noexcept override {
    if (!std::exchange(given_, false)) return;
    if (!all) {
      retry_ = now;
      return;
    }
    ++sent_;
    if (sent_ <= kStops) stopped_ = 0;
  }

  Frame Torque(double torque) noexcept override {
    if (step_ != Step::kArmed) torque = 0;
    if (!(std::abs(torque) <= most_)) ++saturations_;
    if (!std::isfinite(torque)) torque = 0;
    switch (step_) {
      case Step::kAwait:
      case Step::kArmed:
        may_run_ = true;
        return MakeCommand(node_, {.torque = std::clamp(torque, -most_, most_),
                                   .max_torque = most_,
                                   .timeout = watchdog_ / 1000});
      case Step::kSettle:
        question_ = (question_ + 1) % std::size(kArmingQuestions);
        return MakeStop(node_, kArmingQuestions[question_]);
      case Step::kRest:
      case Step::kDisarming:
        break;
    }
    return MakeStop(node_);
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
  enum class Step { kRest, kSettle, kAwait, kArmed, kDisarming };

  /// The driver asks for setpoints, be they zero.
  bool Active() const noexcept { return step_ != Step::kRest && step_ != Step::kDisarming; }

  void Enter(Step step, int64_t now) noexcept {
    step_ = step;
    entered_ = retry_ = now;
    sent_ = stopped_ = running_ = 0;
  }

  bool Retry(int64_t now) noexcept {
    if (now < retry_) return false;
    retry_ = now + kRetry;
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

  void GiveUpArming(int64_t now) noexcept {
    const int mode = reports_.mode();
    if (step_ == Step::kAwait) {
      Fail(now, "it does not start: mode {} ({}), {}", mode, DescribeMode(mode),
           DescribeFault(reports_.fault()));
    } else if (misfits_ > 0) {
      Fail(now, "its answers are not as asked for: has its firmware no register {:#05x}?",
           static_cast<int>(kMilliseconds));
    } else if (stopped_ > 0 && !reports_.register_map()) {
      Fail(now, "it does not say which firmware it has");
    } else if (stopped_ > 0 && !reports_.timeout_mode()) {
      Fail(now, "it does not say what its servo.timeout_mode is");
    } else if (mode != kStopped) {
      Fail(now, "it does not stop: mode {} ({})", mode, DescribeMode(mode));
    } else {
      Fail(now, "it does not answer (ids {:#06x} and {:#05x})", CommandId(node_), AnswerId(node_));
    }
  }

  // What the motor is doing, from its latest answer.
  void OnMode(int64_t now) noexcept {
    if (const auto uptime = reports_.TakeRestart()) {
      lost_place_ = true;
      if (Active()) Fail(now, "it has restarted {} ms ago", *uptime);
    }
    const int mode = reports_.mode();
    stopped_ = mode == kStopped ? stopped_ + 1 : 0;
    running_ = mode == kPositionMode ? running_ + 1 : 0;
    switch (step_) {
      case Step::kRest:
        // It is of no use to clear a fault before somebody has seen it.
        if (mode != kStopped && mode != kFaulted) Disarm(now);
        return;
      case Step::kSettle:
        if (stopped_ >= kAnswersToArm && reports_.register_map() && reports_.timeout_mode())
          Settled(now);
        return;
      case Step::kAwait:
        if (mode == kFaulted) FailFaulty(now);
        if (mode == kTimedOut) Fail(now, "its watchdog expired while it was being armed");
        if (running_ >= kAnswersToArm) Enter(Step::kArmed, now);
        return;
      case Step::kArmed:
        if (mode == kFaulted) return FailFaulty(now);
        if (mode == kTimedOut) {
          return Fail(now, "its watchdog has expired: no command for {} ms", watchdog_ / 1000);
        }
        if (mode != kPositionMode)
          Fail(now, "it left position mode for mode {} ({})", mode, DescribeMode(mode));
        return;
      case Step::kDisarming:
        if (sent_ >= kStops && stopped_ > 0) {
          may_run_ = false;
          Enter(Step::kRest, now);
        }
        return;
    }
  }

  void FailFaulty(int64_t now) noexcept {
    Fail(now, "the motor reports fault {} ({})", reports_.fault(), DescribeFault(reports_.fault()));
  }

  void Settled(int64_t now) noexcept {
    if (*reports_.register_map() != kKnownMap) {
      Fail(now, "its registers are of map {}, and {} is what is known: another firmware",
           *reports_.register_map(), kKnownMap);
    } else if (*reports_.timeout_mode() != kStopped) {
      Fail(now,
           "its servo.timeout_mode is {}: without commands it would not let go; cure: conf set "
           "servo.timeout_mode 0, conf write",
           *reports_.timeout_mode());
    } else {
      Enter(Step::kAwait, now);
    }
  }

  const int node_;
  const double most_;       // [Nm]
  const int64_t watchdog_;  // [us]
  const MotorTiming timing_;

  MoteusReports reports_;
  bool heard_ = false, present_ = false;  // ever, lately
  int64_t answered_ = 0;                  // time of the last answer
  int64_t misfits_ = 0;                   // since Arm: frames that were none of its answers
  int64_t saturations_ = 0;
  size_t question_ = 0;  // of the arming ones, the latest

  // Whoever was here before us may have left it running.
  Step step_ = Step::kDisarming;
  int64_t entered_ = 0, retry_ = std::numeric_limits<int64_t>::min();
  int sent_ = 0;                   // in this step: frames of Tick's accepted
  int stopped_ = 0, running_ = 0;  // in this step: answers in a row that say so
  bool given_ = false;             // the last Tick gave a frame
  bool may_run_ = false;           // may have had setpoints, and is not known to have stopped
  bool fault_ = false;
  bool lost_place_ = false;
  Reason reason_;
};

}  // namespace

std::unique_ptr<Motor> MakeMoteusMotor(const MotorDescription& description,
                                       const MotorTiming& timing) {
  if (!description.moteus) throw std::invalid_argument("a moteus needs its greatest torque");
  const MoteusDescription& moteus = *description.moteus;
  if (description.node < 1 || description.node > kMaxNode) {
    throw std::invalid_argument(
        fmt::format("moteus id {} is not in [1, {}]", description.node, kMaxNode));
  }
  const auto positive = [](double value) { return value > 0 && std::isfinite(value); };
  if (!positive(moteus.torque) || !positive(moteus.watchdog) || moteus.watchdog > 32.767) {
    throw std::invalid_argument(
        "a moteus' torque and watchdog must be positive, and the watchdog less than 32.768 s");
  }
  return std::make_unique<MoteusMotor>(description.node, moteus, timing);
}

}  // namespace plumb
