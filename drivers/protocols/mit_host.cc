#include "drivers/protocols/mit_host.h"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "common/time_units.h"
#include "drivers/protocols/mit.h"

namespace plumb {
namespace {

using namespace mit;

constexpr int64_t kRetry = 20'000;  // [us] between repetitions; much longer than a reply takes
constexpr int kZeroFrames = 3;      // frames of zero gains before "enter"
constexpr int kEnters = 2;          // one of them may be lost on the bus
constexpr int kExits = 2;           // a reply to the first may be one to an earlier frame
constexpr int kRepliesToArm = 2;
constexpr double kUneven = 0.01;  // [s] by which replies may come early or late

class MitMotor : public Motor {
 public:
  MitMotor(int node, const MitDescription& mit, const MotorTiming& timing)
      : node_(node),
        master_(static_cast<uint32_t>(mit.master)),
        ranges_(mit.ranges),
        command_(CommandLayout(ranges_)),
        replies_by_length_{ReplyLayout(ranges_, kPlain), ReplyLayout(ranges_, kWithVoltage),
                           ReplyLayout(ranges_, kWithTemperature)},
        timing_(timing) {}

  Filter filter() const override { return {.id = master_}; }

  FrameUse OnFrame(const Frame& frame, int64_t now) noexcept override {
    if (frame.extended || frame.remote || frame.error || frame.fd || frame.id != master_ ||
        frame.length == 0 || frame.data[0] != node_) {
      return FrameUse::kNotMine;
    }
    if (frame.length < kPlain || frame.length > kWithTemperature) return FrameUse::kRejected;
    const auto values = DecodePayload(replies_by_length_[frame.length - size_t{kPlain}], frame);
    if (!values) return FrameUse::kRejected;
    const bool continuous = present_ && now - reply_ <= timing_.heartbeat_timeout;
    Track((*values)[1], continuous ? now - reply_ : -1, now);
    estimate_.velocity = (*values)[2];
    torque_estimate_ = (*values)[3];
    if (frame.length == kWithVoltage) readings_.bus_voltage = (*values)[4];
    if (frame.length == kWithTemperature) {
      readings_.motor_temperature = (*values)[4];
      readings_.temperatures_at = now;
    }
    // Of this reply: what a stranger says of a motor that reports no errors must not stay.
    error_ = frame.length == kWithTemperature ? static_cast<int>((*values)[5]) : kNoError;
    heard_ = present_ = true;
    reply_ = now;
    ++replies_;
    if (error_ != kNoError && (Arming() || step_ == Step::kArmed)) {
      Fail(now, "the motor reports {} (error {})", DescribeError(error_), error_);
    }
    if (step_ == Step::kAwait && replies_ >= kRepliesToArm) Enter(Step::kArmed, now);
    return FrameUse::kEstimate;
  }

  const MotorEstimate& estimate() const noexcept override { return estimate_; }
  double torque_estimate() const noexcept override { return torque_estimate_; }
  MotorReadings readings() const noexcept override { return readings_; }
  int64_t saturations() const noexcept override { return saturations_; }

  void Arm(int64_t now) noexcept override {
    if (step_ == Step::kArmed) return;
    fault_ = false;
    reason_.Clear();
    Enter(Step::kZeros, now);
  }

  void Disarm(int64_t now) noexcept override { Enter(Step::kDisarming, now); }

  // The protocol has no emergency stop but this.
  void Estop(int64_t now) noexcept override {
    Fail(now, "emergency stop requested");
    Disarm(now);
  }

  void Tick(int64_t now, bool may_arm, FrameBatch& out) noexcept override {
    const size_t before = out.size();
    present_ = heard_ && now - reply_ <= timing_.heartbeat_timeout;
    if (!present_ && heard_ && (Arming() || step_ == Step::kArmed)) {
      Fail(now, "no reply for {} ms", (now - reply_) / 1000);
    }
    if (step_ == Step::kZeros && sent_ >= kZeroFrames && replies_ > 0) Enter(Step::kEnter, now);
    const bool late = now - entered_ >= timing_.heartbeat_timeout;
    switch (step_) {
      case Step::kRest:
        if (present_ || Retry(now)) out.Push(MakeCommand(command_, node_, {}));
        break;
      case Step::kZeros:
        if (late && sent_ >= kZeroFrames) {
          Fail(now, "it does not answer (id {:#05x}, replies expected on {:#05x})", node_, master_);
          break;
        }
        [[fallthrough]];
      case Step::kEnter:
        if (late) {
          Fail(now, "the bus has not taken its arming frames for {} ms", (now - entered_) / 1000);
        } else if (may_arm) {
          if (step_ == Step::kEnter) may_run_ = true;
          out.Push(step_ == Step::kEnter ? MakeSpecial(node_, kEnter)
                                         : MakeCommand(command_, node_, {}));
        }
        break;
      case Step::kAwait:
        if (late) Fail(now, "no reply after it was told to enter motor mode");
        break;
      case Step::kArmed:
        break;
      case Step::kDisarming:
        if (sent_ >= kExits && replies_ > 0) {
          may_run_ = false;
          Enter(Step::kRest, now);
        } else if (Retry(now)) {
          out.Push(MakeSpecial(node_, kExit));
        }
    }
    given_ = out.size() > before;
  }

  void Transmitted(bool all, int64_t now) noexcept override {
    if (!std::exchange(given_, false)) return;
    if (!all) {
      retry_ = now;
      return;
    }
    ++sent_;
    if (step_ == Step::kEnter && sent_ >= kEnters) Enter(Step::kAwait, now);
    if (step_ == Step::kDisarming && sent_ <= kExits) replies_ = 0;
  }

  Frame Torque(double torque) noexcept override {
    if (step_ != Step::kArmed) torque = 0;
    if (!Holds(command_, {.torque = torque})) ++saturations_;
    return MakeCommand(command_, node_, {.torque = std::isfinite(torque) ? torque : 0});
  }

  bool lost_place() const noexcept override { return lost_place_; }
  void Homed() noexcept override { lost_place_ = false; }
  void Displaced() noexcept override {
    displaced_ = true;
    lost_place_ = false;
  }

  DriveState state() const noexcept override {
    if (!present_) return DriveState::kAbsent;
    if (fault_) return DriveState::kFault;
    if (Arming()) return DriveState::kArming;
    return step_ == Step::kArmed ? DriveState::kArmed : DriveState::kIdle;
  }
  std::string_view reason() const noexcept override {
    if (reason_.text().empty() && !present_) return heard_ ? "no reply any more" : "no reply yet";
    return reason_.text();
  }
  bool confirmed_idle() const noexcept override {
    return step_ == Step::kRest || (!present_ && !may_run_);
  }

 private:
  enum class Step { kRest, kZeros, kEnter, kAwait, kArmed, kDisarming };

  bool Arming() const noexcept { return step_ >= Step::kZeros && step_ <= Step::kAwait; }

  void Enter(Step step, int64_t now) noexcept {
    step_ = step;
    entered_ = retry_ = now;
    sent_ = replies_ = 0;
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
    if (Arming() || step_ == Step::kArmed) Disarm(now);
  }

  /// @param raw [rad] position of a reply. @param dt [us] since the one before, -1 = too long ago
  /// to count turns from there.
  void Track(double raw, int64_t dt, int64_t now) noexcept {
    const double step = std::remainder(raw - raw_, Period(ranges_));
    const bool displaced = std::exchange(displaced_, false);
    raw_ = raw;
    if (dt < 0) {
      estimate_.position = raw;
      return;
    }
    if (!displaced && std::abs(step) > ranges_.velocity * (Seconds(dt) + kUneven)) {
      lost_place_ = true;
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
  const MotorTiming timing_;

  MotorEstimate estimate_;
  double torque_estimate_ = std::numeric_limits<double>::quiet_NaN();
  MotorReadings readings_;
  double raw_ = 0;  // [rad] position of the last reply
  int error_ = kNoError;
  bool heard_ = false, present_ = false;  // ever, lately
  int64_t reply_ = 0;                     // time of the last one
  int64_t saturations_ = 0;

  // Whoever was here before us may have left it switched on.
  Step step_ = Step::kDisarming;
  int64_t entered_ = 0, retry_ = std::numeric_limits<int64_t>::min();
  int sent_ = 0, replies_ = 0;  // in this step: frames accepted, frames received
  bool given_ = false;          // the last Tick gave a frame
  bool may_run_ = false;        // told to run, and not known to have stopped since
  bool fault_ = false;
  bool displaced_ = false;  // since the last reply
  bool lost_place_ = false;
  Reason reason_;
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
