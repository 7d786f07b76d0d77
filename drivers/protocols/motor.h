#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "common/special_numbers.h"
#include "drivers/can/frame.h"
#include "drivers/can/transport.h"
#include "drivers/protocols/bus_device.h"
#include "drivers/protocols/reason.h"
#include "robot/description.h"

namespace plumb {

/// How a drive is. The numbers are those of driver_status_t.
enum class DriveState : int8_t { kAbsent = 0, kIdle = 1, kArming = 2, kArmed = 3, kFault = 4 };

/// Latest measurement, at the shaft that the drive reports and commands.
struct MotorEstimate {
  double position = 0;  ///< [rad]
  double velocity = 0;  ///< [rad/s]
};

/// A drive's other reports, for whoever watches over it. NaN = it does not report that, or has
/// not yet.
struct MotorReadings {
  double motor_temperature = kNaN;  ///< [degC]
  /// [degC] of its power stage
  double drive_temperature = kNaN;
  double bus_voltage = kNaN;    ///< [V] of its supply
  double bus_current = kNaN;    ///< [A] from its supply
  int64_t temperatures_at = 0;  ///< [us] when it reported temperatures last; 0 before it has
};

/// A motor's verdict on a frame.
enum class FrameUse {
  kNotMine,    ///< another id, or of a kind that this drive does not send: remote, error, FD ...
  kRejected,   ///< its id, but too short, not finite or of an unknown kind
  kNotFinite,  ///< no MotorEstimate, as what carries one has numbers that are none
  kConsumed,
  kEstimate,  ///< carried a new MotorEstimate
};

/// The most frames of the arming sequence that a drive is given in a Tick.
inline constexpr size_t kMaxArmingFrames = 2;

/// The host's side of one drive: what a protocol must offer. Pure logic: no sockets, no clock. All
/// methods but the constructor are free of exceptions and allocation; times are scaled monotonic
/// microseconds. Frames to send go into a batch. Units are SI at the shaft that the drive reports
/// and commands; drives' own units end here. Not thread-safe.
class Motor {
 public:
  virtual ~Motor() = default;

  /// Ids of the frames this drive sends.
  virtual Filter filter() const = 0;

  virtual FrameUse OnFrame(const Frame& frame, int64_t now) noexcept = 0;
  virtual const MotorEstimate& estimate() const noexcept = 0;
  /// [Nm] the drive's torque estimate; NaN if it does not report one.
  virtual double torque_estimate() const noexcept = 0;
  /// The newest of each.
  virtual MotorReadings readings() const noexcept { return {}; }
  /// The drive's own name for itself, such as "firmware 0.6.10, hardware 4.4.58"; empty if it has
  /// not said.
  virtual std::string_view identity() const noexcept { return {}; }

  /// Begins the arming sequence, from any state but armed. state() tells how it goes.
  virtual void Arm(int64_t now) noexcept = 0;
  /// Asks for zero torque and idle, again and again until the drive says so.
  virtual void Disarm(int64_t now) noexcept = 0;
  /// The drive's own emergency stop.
  virtual void Estop(int64_t now) noexcept = 0;
  /// True if the drive has restarted and counts its position from elsewhere: until a person has
  /// homed the joint.
  virtual bool lost_place() const noexcept { return false; }
  /// A person has.
  virtual void Homed() noexcept {}
  /// Whether the frame is somebody else's emergency stop for this drive, or for all.
  virtual bool IsEstop(const Frame&) const noexcept { return false; }
  /// Once per cycle: deadlines, and the next frames of the sequence under way.
  /// @param may_arm false: no room for kMaxArmingFrames in this cycle, the sequence waits.
  virtual void Tick(int64_t now, bool may_arm, FrameBatch& out) noexcept = 0;
  /// How many readings it asks for in turn: with telemetry that comes unasked, all drives' would
  /// sometimes come at once.
  virtual int num_polled() const noexcept { return 0; }
  /// The question for the next of them.
  virtual void Poll(FrameBatch&) noexcept {}
  /// After each Tick. @param all whether the transport took all frames of that Tick. If not, they
  /// count as not sent, and the next Tick gives them again: no step follows one that did not
  /// happen.
  virtual void Transmitted(bool all, int64_t now) noexcept = 0;
  /// The frame of a torque setpoint [Nm]. Sent in every cycle while arming (zero) and armed.
  /// Whatever the number, it is a setpoint a drive can obey: 0 for one that is not finite, the
  /// nearest for one beyond its range.
  virtual Frame Torque(double torque) noexcept = 0;
  /// The robot may have been put elsewhere at once, as happens to a virtual one: the next position
  /// is not judged by those before, and the drive has not lost its place.
  virtual void Displaced() noexcept {}
  /// Setpoints that the protocol could not say as they were: beyond its range, or not finite.
  virtual int64_t saturations() const noexcept { return 0; }

  virtual DriveState state() const noexcept = 0;
  /// Why it is not armed: decoded errors, the step at which arming failed. Empty if there is
  /// nothing to say.
  virtual std::string_view reason() const noexcept = 0;
  /// True once the drive has confirmed that it is not armed, or if it is absent and was never armed
  /// since.
  virtual bool confirmed_idle() const noexcept = 0;
};

/// The driver's settings that concern a motor.
struct MotorTiming {
  /// [us] silence after which a drive counts as absent; also for each arming step
  int64_t heartbeat_timeout;
};

}  // namespace plumb
