#include "drivers/protocols/moteus_host.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "common/time_units.h"
#include "drivers/protocols/answering_motor.h"
#include "drivers/protocols/moteus.h"
#include "drivers/protocols/moteus_reports.h"

namespace plumb {
namespace {

using namespace moteus;

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

enum class Step { kRest, kSettle, kAwait, kArmed, kDisarming };

class MoteusMotor : public AnsweringMotor<Step> {
 public:
  MoteusMotor(int node, const MoteusDescription& settings, const MotorTiming& timing)
      : AnsweringMotor(timing),
        node_(node),
        most_(settings.torque),
        watchdog_(Microseconds(settings.watchdog)) {}

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
    if (step() == Step::kArmed && now - answered() >= watchdog_) FailSilent(now);
    Hear(now);
    if (reports_.answers() != answers) OnMode(now);
    return use;
  }

  const MotorEstimate& estimate() const noexcept override { return reports_.estimate(); }
  double torque_estimate() const noexcept override { return reports_.torque_estimate(); }
  MotorReadings readings() const noexcept override { return reports_.readings(); }
  std::string_view identity() const noexcept override { return reports_.identity(); }

  bool IsEstop(const Frame& frame) const noexcept override {
    const uint32_t to = frame.id & 0xFF;
    return !frame.remote && frame.length >= 3 &&
           (to == static_cast<uint32_t>(node_) || to == kEverybody) && frame.id <= 0xFFFF &&
           frame.data[0] == (kWrite | kInt8 | 1) && frame.data[1] == kMode &&
           frame.data[2] == kStopped;
  }

  void Tick(int64_t now, bool, FrameBatch& out) noexcept override {
    // Text and numbers take it no longer than a setpoint does.
    Watch(now, step() == Step::kArmed ? watchdog_ : heartbeat_timeout());
    if (Active() && step() != Step::kArmed && Late(now)) GiveUpArming(now);
    const bool speak = !Active() && (present() || Retry(now, kRetry));
    Give(speak);
    if (!speak) return;
    out.Push(step() == Step::kRest ? MakeFrame(CommandId(node_), {kQuestion}) : MakeStop(node_));
  }

  Frame Torque(double torque) noexcept override {
    if (step() != Step::kArmed) torque = 0;
    if (!(std::abs(torque) <= most_)) CountSaturation();
    if (!std::isfinite(torque)) torque = 0;
    switch (step()) {
      case Step::kAwait:
      case Step::kArmed:
        MayRun();
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

 private:
  void BeginArming(int64_t now) noexcept override {
    misfits_ = 0;
    reports_.ForgetSettings();
    Enter(Step::kSettle, now);
  }

  void ForgetAnswers() noexcept override { stopped_ = running_ = 0; }

  void GiveUpArming(int64_t now) noexcept {
    const int mode = reports_.mode();
    if (step() == Step::kAwait) {
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
      LosePlace();
      if (Active()) Fail(now, "it has restarted {} ms ago", *uptime);
    }
    const int mode = reports_.mode();
    stopped_ = mode == kStopped ? stopped_ + 1 : 0;
    running_ = mode == kPositionMode ? running_ + 1 : 0;
    switch (step()) {
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
        if (Stopped(stopped_)) Rest(now);
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

  MoteusReports reports_;
  int64_t misfits_ = 0;            // since Arm: frames that were none of its answers
  size_t question_ = 0;            // of the arming ones, the latest
  int stopped_ = 0, running_ = 0;  // in this step: answers in a row that say so
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
