// Of cansimple_motor.h: what the drive says.

#include "drivers/protocols/cansimple.h"
#include "drivers/protocols/cansimple_motor.h"

namespace plumb {

using namespace cansimple;

FrameUse CanSimpleMotor::OnFrame(const Frame& frame, int64_t now) noexcept {
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
    LosePlace();
    const int64_t silent = restart->silence / 1000;
    if (restart->jump)
      Fail(now,
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

FrameUse CanSimpleMotor::OnHeartbeat(const Frame& frame, int64_t now) noexcept {
  const auto values = DecodePayload(kHeartbeat, frame);
  if (!values) return FrameUse::kRejected;
  Hear(now);
  axis_error_ = static_cast<uint32_t>((*values)[0]);
  axis_state_ = static_cast<int>((*values)[1]);
  axis_state_known_ = true;
  reports_.OnHeartbeat(axis_state_, now);
  if (axis_state_ == kClosedLoopControl) MayRun();
  procedure_result_ = static_cast<int>((*values)[2]);
  ++beats_;
  const bool running = axis_state_ == kClosedLoopControl && axis_error_ == 0;
  if (step() == Step::kAwait && running) Enter(Step::kArmed, now);
  // The state counts, not only the error: drives have been seen to fall to IDLE with error 0.
  if (step() == Step::kArmed && !running) {
    if (axis_state_ == kClosedLoopControl)
      Fail(now, "the drive reports: {}", Words(axis_error_));
    else
      Fail(now, "the drive went to {}: {} ({})", DescribeAxisState(axis_state_), Words(axis_error_),
           DescribeProcedureResult(procedure_result_));
    ask_error_ = true;
  }
  return FrameUse::kConsumed;
}

FrameUse CanSimpleMotor::OnError(const Frame& frame) noexcept {
  const auto values = DecodePayload(kGetError, frame);
  if (!values) return FrameUse::kRejected;
  const auto disarm_reason = static_cast<uint32_t>((*values)[1]);
  if (faulty() && step() != Step::kArmed && axis_error_ == 0 && disarm_reason != 0) {
    Explain("the drive disarmed itself: {}", Words(disarm_reason));
  }
  return FrameUse::kConsumed;
}

}  // namespace plumb
