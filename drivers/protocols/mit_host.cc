#include "drivers/protocols/mit_host.h"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "common/special_numbers.h"
#include "common/time_units.h"
#include "drivers/protocols/answering_motor.h"
#include "drivers/protocols/mit.h"

namespace plumb {
namespace {

using namespace mit;

constexpr int kZeroFrames = 3;  // frames of zero gains before "enter"
constexpr int kEnters = 2;      // one of them may be lost on the bus
constexpr int kRepliesToArm = 2;
constexpr double kUneven = 0.01;               // [s] by which replies may come early or late
constexpr double kUnmoved = 0.1;               // [rad] that a joint may have sagged by in a silence
constexpr int64_t kShortestRestart = 100'000;  // [us] of silence

enum class Step { kRest, kZeros, kEnter, kAwait, kArmed, kDisarming };

class MitMotor : public AnsweringMotor<Step> {
 public:
  MitMotor(int node, const MitDescription& mit, const MotorTiming& timing)
      : AnsweringMotor(timing),
        node_(node),
        master_(static_cast<uint32_t>(mit.master)),
        ranges_(mit.ranges),
        command_(CommandLayout(ranges_)),
        replies_by_length_{ReplyLayout(ranges_, kPlain), ReplyLayout(ranges_, kWithVoltage),
                           ReplyLayout(ranges_, kWithTemperature)} {}

  Filter filter() const override { return {.id = master_}; }

  FrameUse OnFrame(const Frame& frame, int64_t now) noexcept override {
    if (frame.extended || frame.remote || frame.error || frame.fd || frame.id != master_ ||
        frame.length == 0 || frame.data[0] != node_) {
      return FrameUse::kNotMine;
    }
    if (frame.length < kPlain || frame.length > kWithTemperature) return FrameUse::kRejected;
    const auto values = DecodePayload(replies_by_length_[frame.length - size_t{kPlain}], frame);
    if (!values) return FrameUse::kRejected;
    Track((*values)[1], now);
    estimate_.velocity = (*values)[2];
    torque_estimate_ = (*values)[3];
    if (frame.length == kWithVoltage) readings_.bus_voltage = (*values)[4];
    if (frame.length == kWithTemperature) {
      readings_.motor_temperature = (*values)[4];
      readings_.temperatures_at = now;
    }
    // Of this reply: what a stranger says of a motor that reports no errors must not stay.
    error_ = frame.length == kWithTemperature ? static_cast<int>((*values)[5]) : kNoError;
    Hear(now);
    ++replies_;
    if (error_ != kNoError && Active()) {
      Fail(now, "the motor reports {} (error {})", DescribeError(error_), error_);
    }
    if (step() == Step::kAwait && replies_ >= kRepliesToArm) Enter(Step::kArmed, now);
    return FrameUse::kEstimate;
  }

  const MotorEstimate& estimate() const noexcept override { return estimate_; }
  double torque_estimate() const noexcept override { return torque_estimate_; }
  MotorReadings readings() const noexcept override { return readings_; }

  void Tick(int64_t now, bool may_arm, FrameBatch& out) noexcept override {
    const size_t before = out.size();
    Watch(now, heartbeat_timeout());
    if (step() == Step::kZeros && sent() >= kZeroFrames && replies_ > 0) Enter(Step::kEnter, now);
    const bool late = Late(now);
    switch (step()) {
      case Step::kRest:
        if (present() || Retry(now, kRetry)) out.Push(MakeCommand(command_, node_, {}));
        break;
      case Step::kZeros:
        if (late && sent() >= kZeroFrames) {
          Fail(now, "it does not answer (id {:#05x}, replies expected on {:#05x})", node_, master_);
          break;
        }
        [[fallthrough]];
      case Step::kEnter:
        if (late) {
          Fail(now, "the bus has not taken its arming frames for {} ms", Since(now));
        } else if (may_arm) {
          if (step() == Step::kEnter) MayRun();
          out.Push(step() == Step::kEnter ? MakeSpecial(node_, kEnter)
                                          : MakeCommand(command_, node_, {}));
        }
        break;
      case Step::kAwait:
        if (late) Fail(now, "no answer after it was told to enter motor mode");
        break;
      case Step::kArmed:
        break;
      case Step::kDisarming:
        if (Stopped(replies_)) {
          Rest(now);
        } else if (Retry(now, kRetry)) {
          out.Push(MakeSpecial(node_, kExit));
        }
    }
    Give(out.size() > before);
  }

  Frame Torque(double torque) noexcept override {
    if (step() != Step::kArmed) torque = 0;
    if (!Holds(command_, {.torque = torque})) CountSaturation();
    return MakeCommand(command_, node_, {.torque = std::isfinite(torque) ? torque : 0});
  }

  void Displaced() noexcept override {
    displaced_ = true;
    AnsweringMotor::Displaced();
  }

 private:
  void BeginArming(int64_t now) noexcept override { Enter(Step::kZeros, now); }
  void ForgetAnswers() noexcept override { replies_ = 0; }
  void OnSent(int64_t now) noexcept override {
    if (step() == Step::kEnter && sent() >= kEnters) Enter(Step::kAwait, now);
  }

  /// Turns are counted from one reply to the next. In a silence the motor may have lost its power,
  /// and with it the turns: where it then is elsewhere, nobody knows whether it was turned or
  /// counts from elsewhere. Where it is as it was, the turns are, too.
  /// @param raw [rad] position of a reply.
  void Track(double raw, int64_t now) noexcept {
    const double step = std::remainder(raw - raw_, Period(ranges_));
    const int64_t dt = now - answered();
    const bool displaced = std::exchange(displaced_, false);
    const bool silent = !present() || dt > std::min(heartbeat_timeout(), kShortestRestart);
    raw_ = raw;
    if (!heard() || displaced) {
      estimate_.position = raw;
      return;
    }
    const double explained = silent ? kUnmoved : ranges_.velocity * (Seconds(dt) + kUneven);
    if (std::abs(step) > explained) {
      LosePlace();
      Fail(now,
           "its position jumped by {:.3g} rad in {:.3g} ms: it has restarted, or lost its place",
           step, static_cast<double>(dt) * 1e-3);
      estimate_.position = raw;
      return;
    }
    estimate_.position += step;
  }

  const int node_;
  const uint32_t master_;
  const MitRanges ranges_;
  const Layout command_;
  const std::array<Layout, 3> replies_by_length_;

  MotorEstimate estimate_;
  double torque_estimate_ = kNaN;
  MotorReadings readings_;
  double raw_ = 0;  // [rad] position of the last reply
  int error_ = kNoError;
  int replies_ = 0;         // in this step
  bool displaced_ = false;  // since the last reply
};

bool Positive(const MitRanges& ranges) {
  for (const double range :
       {ranges.position, ranges.velocity, ranges.torque, ranges.kp, ranges.kd}) {
    if (!(range > 0) || !std::isfinite(range)) return false;
  }
  return true;
}

}  // namespace

std::string_view mit::DescribeError(int error) noexcept {
  switch (error) {
    case kNoError:
      return "no error";
    case kOverTemperature:
      return "over-temperature";
    case kOverCurrent:
      return "over-current";
    case kOverVoltage:
      return "over-voltage";
    case kUnderVoltage:
      return "under-voltage";
    case kEncoderError:
      return "an encoder error";
    case kPhaseUnbalance:
      return "unbalanced phases";
    default:
      return "an unknown error";
  }
}

std::unique_ptr<Motor> MakeMitMotor(const MotorDescription& description,
                                    const MotorTiming& timing) {
  if (!description.mit) throw std::invalid_argument("a MIT motor needs ranges");
  const MitDescription& mit = *description.mit;
  if (description.node < 1 || description.node > 0xFF) {
    throw std::invalid_argument(
        fmt::format("MIT motor id {} is not in [1, 255]", description.node));
  }
  if (mit.master < 0 || mit.master > 0x7FF || mit.master == description.node) {
    throw std::invalid_argument(
        fmt::format("MIT reply id {} is the motor's own or not in [0, 0x7FF]", mit.master));
  }
  if (!Positive(mit.ranges)) throw std::invalid_argument("a MIT motor's ranges must be positive");
  return std::make_unique<MitMotor>(description.node, mit, timing);
}

}  // namespace plumb
