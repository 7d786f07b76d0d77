#include "drivers/protocols/cansimple_host.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "drivers/protocols/cansimple.h"
#include "drivers/protocols/cansimple_motor.h"

namespace plumb {
namespace {

using namespace cansimple;

constexpr int64_t kRetry = 50'000;      // [us] between repetitions of an unanswered frame
constexpr int kDisarmsBeforeEstop = 5;  // a drive that ignores these gets its emergency stop
// heartbeats a drive has to enter closed loop; the first may be on its way
constexpr int kBeatsToArm = 4;

}  // namespace

void CanSimpleMotor::BeginArming(int64_t now) noexcept {
  estop_due_ = false;
  reports_.ForgetFirmware();
  Enter(Step::kVersion, now);
}

void CanSimpleMotor::Disarm(int64_t now) noexcept {
  disarms_ = 0;
  axis_state_known_ = false;  // an old heartbeat proves nothing
  // Nor does a new one while our order to run may be on its way: first the order to stop.
  order_due_ = may_run();
  Enter(Step::kDisarming, now);
}

bool CanSimpleMotor::IsEstop(const Frame& frame) const noexcept {
  const uint32_t to = frame.id >> 5;
  return (frame.id & 0x1F) == kEstop.command && !frame.remote &&
         (to == static_cast<uint32_t>(node_) || to == kBroadcastNode);
}

void CanSimpleMotor::Estop(int64_t now) noexcept {
  Fail(now, "emergency stop requested");
  disarms_ = kDisarmsBeforeEstop;
  estop_due_ = true;
}

void CanSimpleMotor::Poll(FrameBatch& out) noexcept {
  out.Push(MakeRequest(kPolledReports[poll_turn_++ % kPolledReports.size()], node_));
}

void CanSimpleMotor::Tick(int64_t now, bool may_arm, FrameBatch& out) noexcept {
  const size_t before = out.size();
  NotePresence(now);
  if (!present() && heard() && Active()) Fail(now, "no heartbeat for {} ms", SilentFor(now));
  const auto& firmware = reports_.firmware();
  if (step() == Step::kVersion && present() && firmware && Spoken(*firmware))
    Enter(Step::kClear, now);
  const bool late = Late(now);
  switch (step()) {
    case Step::kRest:
      // Armed behind our back, or by a frame that was still on its way when we disarmed.
      if (present() && axis_state_ == kClosedLoopControl) Disarm(now);
      break;
    case Step::kVersion:
      if (firmware && !Spoken(*firmware)) {
        Fail(now, "its firmware is {}.{}, this driver speaks 0.6", firmware->major,
             firmware->minor);
      } else if (late && firmware) {
        Fail(now, "it answers, but sends no heartbeat");
      } else if (late) {
        Fail(now, "it does not answer Get_Version (firmware older than 0.6?)");
      } else if (!firmware && may_arm && Retry(now, kRetry)) {
        out.Push(MakeRequest(kGetVersion, node_));
      }
      break;
    case Step::kClear:
    case Step::kMode:
    case Step::kState:
      if (late) {
        Fail(now, "the bus has not taken its arming frames for {} ms", Since(now));
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
  Give(out.size() > before);
}

void CanSimpleMotor::OnSent(int64_t now) noexcept {
  ask_error_ = false;
  switch (step()) {
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

Frame CanSimpleMotor::Torque(double torque) noexcept {
  const Field& field = kSetInputTorqueShort.fields[0];
  if (!field.Holds(torque)) CountSaturation();
  if (!std::isfinite(torque)) torque = 0;
  return Make(kSetInputTorqueShort, node_, {std::clamp(torque, field.lowest(), field.highest())});
}

// A drive that has lost its power since the first mode would run in the one it wakes up in, which
// holds a position.
void CanSimpleMotor::PushArmingFrames(FrameBatch& out) noexcept {
  if (out.room() < 2) return;
  if (step() == Step::kClear) {
    out.Push(Make(kClearErrors, node_));
    return;
  }
  out.Push(Make(kSetControllerMode, node_, {kTorqueControl, kPassthrough}));
  if (step() == Step::kMode) return;
  out.Push(Make(kSetAxisState, node_, {kClosedLoopControl}));
  MayRun();
}

void CanSimpleMotor::TickDisarming(int64_t now, FrameBatch& out) noexcept {
  if (axis_state_known_ && axis_state_ != kClosedLoopControl && !order_due_ && !estop_due_) {
    return Rest(now);
  }
  if (out.room() < 3 || !Retry(now, kRetry)) return;
  out.Push(Make(kSetInputTorqueShort, node_, {0}));
  out.Push(Make(kSetAxisState, node_, {kIdle}));
  if (disarms_ >= kDisarmsBeforeEstop) out.Push(Make(kEstop, node_));
}

std::unique_ptr<Motor> MakeCanSimpleMotor(const MotorDescription& description,
                                          const MotorTiming& timing) {
  if (description.node < 0 || description.node > kMaxNode) {
    throw std::invalid_argument(
        fmt::format("CANSimple node {} is not in [0, {}]", description.node, kMaxNode));
  }
  return std::make_unique<CanSimpleMotor>(description.node, timing);
}

}  // namespace plumb
