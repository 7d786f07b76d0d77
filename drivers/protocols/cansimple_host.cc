#include "drivers/protocols/cansimple_host.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "drivers/protocols/cansimple.h"
#include "drivers/protocols/cansimple_reports.h"

namespace plumb {
namespace {

using namespace cansimple;

constexpr int64_t kRetry = 50'000;      // [us] between repetitions of an unanswered frame
constexpr int kDisarmsBeforeEstop = 5;  // a drive that ignores these gets its emergency stop
// heartbeats a drive has to enter closed loop; the first may be on its way
constexpr int kBeatsToArm = 4;

class CanSimpleMotor : public Motor {
 public:
  CanSimpleMotor(int node, const MotorTiming& timing) : node_(node), timing_(timing) {}

  Filter filter() const override {
    return {.id = static_cast<uint32_t>(node_) << 5, .mask = 0x7E0};
  }

  FrameUse OnFrame(const Frame& frame, int64_t now) noexcept override {
    if (frame.extended || frame.remote || frame.error || frame.fd ||
        frame.id >> 5 != static_cast<uint32_t>(node_)) {
      return FrameUse::kNotMine;
    }
    const uint32_t command = frame.id & 0x1F;
    const FrameUse use = command == kHeartbeat.command  ? OnHeartbeat(frame, now)
                         : command == kGetError.command ? OnError(frame)
                                                        : reports_.OnFrame(frame, now);
    if (command == kAddress.command && reports_.two_drives())
      Fail(now, "two drives have its node id");
    if (const auto restart = reports_.TakeRestart()) {
      lost_place_ = true;
      const int64_t silent = restart->silence / 1000;
      if (restart->jump)
        Fail(
            now,
            "the drive has restarted (silent for {} ms, then its position jumped by {:.3g} turns): "
            "home the joint anew",
            silent, *restart->jump);
      else
        Fail(now,
             "the drive may have restarted (silent for {} ms, then at zero): home the joint anew",
             silent);
    }
    return use;
  }

  const MotorEstimate& estimate() const noexcept override { return reports_.estimate(); }
  double torque_estimate() const noexcept override { return reports_.torque_estimate(); }
  MotorReadings readings() const noexcept override { return reports_.readings(); }
  std::string_view identity() const noexcept override { return reports_.identity(); }

  void Arm(int64_t now) noexcept override {
    if (step_ == Step::kArmed) return;
    fault_ = estop_due_ = false;
    reason_.Clear();
    reports_.ForgetFirmware();
    Enter(Step::kVersion, now);
  }

  void Disarm(int64_t now) noexcept override {
    disarms_ = 0;
    axis_state_known_ = false;  // an old heartbeat proves nothing
    // Nor does a new one while our order to run may be on its way: first the order to stop.
    order_due_ = may_run_;
    Enter(Step::kDisarming, now);
  }

  bool lost_place() const noexcept override { return lost_place_; }
  void Homed() noexcept override { lost_place_ = false; }
  void Displaced() noexcept override {
    reports_.Displaced();
    lost_place_ = false;
  }
  bool IsEstop(const Frame& frame) const noexcept override {
    const uint32_t to = frame.id >> 5;
    return (frame.id & 0x1F) == kEstop.command && !frame.remote &&
           (to == static_cast<uint32_t>(node_) || to == kBroadcastNode);
  }

  void Estop(int64_t now) noexcept override {
    Fail(now, "emergency stop requested");
    disarms_ = kDisarmsBeforeEstop;
    estop_due_ = true;
  }

  int num_polled() const noexcept override { return static_cast<int>(kPolledReports.size()); }
  void Poll(FrameBatch& out) noexcept override {
    out.Push(MakeRequest(kPolledReports[poll_turn_++ % kPolledReports.size()], node_));
  }

  void Tick(int64_t now, bool may_arm, FrameBatch& out) noexcept override {
    const size_t before = out.size();
    present_ = heard_ && now - heartbeat_ <= timing_.heartbeat_timeout;
    if (!present_ && heard_ && (Arming() || step_ == Step::kArmed)) {
      Fail(now, "no heartbeat for {} ms", (now - heartbeat_) / 1000);
    }
    const auto& firmware = reports_.firmware();
    if (step_ == Step::kVersion && present_ && firmware && Spoken(*firmware))
      Enter(Step::kClear, now);
    const bool late = now - entered_ >= timing_.heartbeat_timeout;
    switch (step_) {
      case Step::kRest:
        // Armed behind our back, or by a frame that was still on its way when we disarmed.
        if (present_ && axis_state_ == kClosedLoopControl) Disarm(now);
        break;
      case Step::kVersion:
        if (firmware && !Spoken(*firmware)) {
          Fail(now, "its firmware is {}.{}, this driver speaks 0.6", firmware->major,
               firmware->minor);
        } else if (late && firmware) {
          Fail(now, "it answers, but sends no heartbeat");
        } else if (late) {
          Fail(now, "it does not answer Get_Version (firmware older than 0.6?)");
        } else if (!firmware && may_arm && Retry(now)) {
          out.Push(MakeRequest(kGetVersion, node_));
        }
        break;
      case Step::kClear:
      case Step::kMode:
      case Step::kState:
        if (late) {
          Fail(now, "the bus has not taken its arming frames for {} ms", (now - entered_) / 1000);
        } else if (may_arm) {
          PushArmingFrames(out);
        }
        break;
      case Step::kAwait:
        if (late || beats_ >= kBeatsToArm) {
          Fail(now, "it stays in {} ({}; {})", DescribeAxisState(axis_state_), Words(axis_error_),
               DescribeProcedureResult(procedure_result_));
        }
        break;
      case Step::kArmed:
        break;
      case Step::kDisarming:
        TickDisarming(now, out);
    }
    if (ask_error_) out.Push(MakeRequest(kGetError, node_));
    given_ = out.size() > before;
  }

  void Transmitted(bool all, int64_t now) noexcept override {
    if (!std::exchange(given_, false)) return;
    if (!all) {
      retry_ = now;
      return;
    }
    ask_error_ = false;
    switch (step_) {
      case Step::kClear:
        return Enter(Step::kMode, now);
      case Step::kMode:
        return Enter(Step::kState, now);
      case Step::kState:
        return Enter(Step::kAwait, now);
      case Step::kDisarming:
        if (disarms_++ >= kDisarmsBeforeEstop) estop_due_ = false;
        if (order_due_) order_due_ = axis_state_known_ = false;
        return;
      default:
        return;
    }
  }

  Frame Torque(double torque) noexcept override {
    const Field& field = kSetInputTorqueShort.fields[0];
    if (!field.Holds(torque)) ++saturations_;
    if (!std::isfinite(torque)) torque = 0;
    return Make(kSetInputTorqueShort, node_, {std::clamp(torque, field.lowest(), field.highest())});
  }
  int64_t saturations() const noexcept override { return saturations_; }

  DriveState state() const noexcept override {
    if (!present_) return DriveState::kAbsent;
    if (fault_) return DriveState::kFault;
    if (Arming()) return DriveState::kArming;
    return step_ == Step::kArmed ? DriveState::kArmed : DriveState::kIdle;
  }
  std::string_view reason() const noexcept override {
    if (reason_.text().empty() && !present_)
      return heard_ ? "no heartbeat any more" : "no heartbeat yet";
    return reason_.text();
  }
  bool confirmed_idle() const noexcept override {
    return step_ == Step::kRest || (!present_ && !may_run_ && !estop_due_);
  }

 private:
  enum class Step { kRest, kVersion, kClear, kMode, kState, kAwait, kArmed, kDisarming };
  static bool Spoken(const CanSimpleReports::Firmware& firmware) noexcept {
    return firmware.major == 0 && firmware.minor == 6;
  }

  bool Arming() const noexcept { return step_ >= Step::kVersion && step_ <= Step::kAwait; }

  void Enter(Step step, int64_t now) noexcept {
    step_ = step;
    entered_ = retry_ = now;
    beats_ = 0;
  }

  std::string_view Words(uint32_t errors) noexcept { return DescribeErrors(errors, words_); }

  // A drive that has lost its power since the first mode would run in the one it wakes up in, which
  // holds a position.
  void PushArmingFrames(FrameBatch& out) noexcept {
    if (out.room() < 2) return;
    if (step_ == Step::kClear) {
      out.Push(Make(kClearErrors, node_));
      return;
    }
    out.Push(Make(kSetControllerMode, node_, {kTorqueControl, kPassthrough}));
    if (step_ == Step::kMode) return;
    out.Push(Make(kSetAxisState, node_, {kClosedLoopControl}));
    may_run_ = true;
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
    // Even one that says it has stopped: it may be another with its node id that has spoken.
    Disarm(now);
  }

  void TickDisarming(int64_t now, FrameBatch& out) noexcept {
    if (axis_state_known_ && axis_state_ != kClosedLoopControl && !order_due_ && !estop_due_) {
      may_run_ = false;
      return Enter(Step::kRest, now);
    }
    if (out.room() < 3 || !Retry(now)) return;
    out.Push(Make(kSetInputTorqueShort, node_, {0}));
    out.Push(Make(kSetAxisState, node_, {kIdle}));
    if (disarms_ >= kDisarmsBeforeEstop) out.Push(Make(kEstop, node_));
  }

  FrameUse OnHeartbeat(const Frame& frame, int64_t now) noexcept {
    const auto values = DecodePayload(kHeartbeat, frame);
    if (!values) return FrameUse::kRejected;
    heard_ = present_ = true;
    heartbeat_ = now;
    axis_error_ = static_cast<uint32_t>((*values)[0]);
    axis_state_ = static_cast<int>((*values)[1]);
    axis_state_known_ = true;
    reports_.OnHeartbeat(axis_state_, now);
    may_run_ = may_run_ || axis_state_ == kClosedLoopControl;
    procedure_result_ = static_cast<int>((*values)[2]);
    ++beats_;
    const bool running = axis_state_ == kClosedLoopControl && axis_error_ == 0;
    if (step_ == Step::kAwait && running) Enter(Step::kArmed, now);
    // The state counts, not only the error: drives have been seen to fall to IDLE with error 0.
    if (step_ == Step::kArmed && !running) {
      if (axis_state_ == kClosedLoopControl)
        Fail(now, "the drive reports: {}", Words(axis_error_));
      else
        Fail(now, "the drive went to {}: {} ({})", DescribeAxisState(axis_state_),
             Words(axis_error_), DescribeProcedureResult(procedure_result_));
      ask_error_ = true;
    }
    return FrameUse::kConsumed;
  }

  FrameUse OnError(const Frame& frame) noexcept {
    const auto values = DecodePayload(kGetError, frame);
    if (!values) return FrameUse::kRejected;
    const auto disarm_reason = static_cast<uint32_t>((*values)[1]);
    if (fault_ && step_ != Step::kArmed && axis_error_ == 0 && disarm_reason != 0) {
      reason_.Set("the drive disarmed itself: {}", Words(disarm_reason));
    }
    return FrameUse::kConsumed;
  }

  const int node_;
  const MotorTiming timing_;
  CanSimpleReports reports_;
  bool heard_ = false, present_ = false;  // ever, lately
  int64_t heartbeat_ = 0;
  uint32_t axis_error_ = 0;
  int axis_state_ = kUndefined, procedure_result_ = 0;
  bool axis_state_known_ = false;  // since the last disarm
  std::array<char, 100> words_;

  Step step_ = Step::kRest;
  int64_t entered_ = 0, retry_ = 0;
  int beats_ = 0, disarms_ = 0;  // heard in this step; accepted
  bool given_ = false;           // the last Tick gave frames
  bool may_run_ = false;         // told to run, or heard running, and not heard idle since
  bool order_due_ = false;       // no order to stop was accepted since the last order to run
  bool estop_due_ = false;       // no Estop was accepted since it was asked for
  bool ask_error_ = false, fault_ = false;
  bool lost_place_ = false;
  size_t poll_turn_ = 0;
  int64_t saturations_ = 0;
  Reason reason_;
};

}  // namespace

std::unique_ptr<Motor> MakeCanSimpleMotor(const MotorDescription& description,
                                          const MotorTiming& timing) {
  if (description.node < 0 || description.node > kMaxNode) {
    throw std::invalid_argument(
        fmt::format("CANSimple node {} is not in [0, {}]", description.node, kMaxNode));
  }
  return std::make_unique<CanSimpleMotor>(description.node, timing);
}

}  // namespace plumb
