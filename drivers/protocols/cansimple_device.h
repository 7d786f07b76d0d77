#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "drivers/can/transport.h"
#include "drivers/protocols/cansimple.h"
#include "drivers/protocols/motor_device.h"
#include "robot/description.h"

namespace plumb {

/// A virtual drive that speaks CANSimple as an ODrive with firmware 0.6 does: pure logic. Its use,
/// with a plant that it drives (times in scaled microseconds of any one clock, never decreasing):
///
///   CanSimpleDevice drive(settings, start);
///   for (;;) {
///     const int64_t t = std::min(drive.NextDue(), now);     // exact instants: samples, watchdog
///     plant.Advance(t, drive.Torque());                     // the torque holds until t
///     for (frame received up to t) drive.OnFrame(frame, t); // may change Torque()
///     batch.Clear();
///     drive.Tick(t, {plant.position, plant.velocity}, batch);
///     transport->Send(batch.frames());
///   }
///
/// Simplifications of the real one: torque control only (position and velocity setpoints feed the
/// watchdog and move nothing), no SDO, no calibration states. Not thread-safe. Does not allocate.
class CanSimpleDevice {
 public:
  struct Settings {
    int node = 1;                        ///< [0, 0x3E]
    int64_t heartbeat_period = 100'000;  ///< [us], > 0
    int64_t encoder_period = 10'000;     ///< [us]; 0 = on request only
    int64_t torques_period = 0;          ///< [us] of Get_Torques; 0 = on request only
    int64_t watchdog = 0;  ///< [us] without a setpoint after which the armed drive disarms; 0 = off
    /// protocol, hardware (3), firmware (4)
    std::array<uint8_t, 8> version = {2, 4, 4, 58, 0, 6, 10, 0};
    /// 48 bits, for the Address message
    uint64_t serial_number = 0;
    double torque_constant = 0.0827;  ///< [Nm/A] for Get_Iq
    /// [V] for Get_Bus_Voltage_Current
    double bus_voltage = 24;
    /// [us] of Get_Temperature and Get_Bus_Voltage_Current; 0 = on request only
    int64_t telemetry_period = 0;
    double temperature = 25;  ///< [degC] of motor and power stage
  };
  struct Sample {
    double position = 0;  ///< [rev] at the motor's shaft
    double velocity = 0;  ///< [rev/s]
  };

  CanSimpleDevice(const Settings& settings, int64_t now);

  /// Which frames concern it, requests and broadcasts included: two filters for a transport.
  std::array<Filter, 2> filters() const;

  /// Obeys a frame; others' are ignored. Answers wait for the next Tick.
  void OnFrame(const Frame& frame, int64_t now) noexcept;

  /// Brings the drive to `now`: watchdog first, then answers, then what is due by the schedule.
  /// Cyclic messages are due at exact multiples of their periods; one tick sends each of them at
  /// most once, so a tick that comes late skips the instants it has missed.
  void Tick(int64_t now, const Sample& sample, FrameBatch& out) noexcept;

  /// The next instant at which Tick has something to do of its own accord.
  int64_t NextDue() const noexcept;

  /// [Nm] the motor produces now: the last setpoint when in closed loop torque control, else 0.
  double Torque() const noexcept;

  /// Loses its power and gets it back at `now`: idle, without a memory of errors and setpoints.
  void Reboot(int64_t now) noexcept;
  void set_bus_voltage(double volts) noexcept { settings_.bus_voltage = volts; }
  void set_temperature(double degrees) noexcept { settings_.temperature = degrees; }

  bool armed() const noexcept { return state_ == cansimple::kClosedLoopControl; }
  int control_mode() const noexcept {
    return control_mode_;
  }  ///< a cansimple::ControlMode, or what was asked
  uint32_t disarm_reason() const noexcept { return disarm_reason_; }
  /// Frames for this node that were too short, not finite or unknown.
  int64_t rejected() const noexcept { return rejected_; }
  int64_t setpoints() const noexcept { return setpoints_; }  ///< torque setpoints accepted

 private:
  void RequestState(int state, int64_t now) noexcept;
  void FallIdle(uint32_t reason) noexcept;
  /// @param torque which of the layout's fields it is; the drive obeys no other
  void OnSetpoint(const Layout& layout, size_t torque, const Frame& frame, int64_t now) noexcept;
  void CheckWatchdog(int64_t now) noexcept;
  Frame Report(uint8_t command, const Sample& sample) const noexcept;

  Settings settings_;
  cansimple::AxisState state_ = cansimple::kIdle;
  int control_mode_ = cansimple::kPositionControl;
  int input_mode_ = cansimple::kPassthrough;
  int procedure_result_ = cansimple::kSuccess;
  uint32_t active_errors_ = 0;  ///< conditions that exist now
  uint32_t disarm_reason_ = 0;  ///< error bits that disarmed it, until Clear_Errors
  double setpoint_ = 0;         ///< [Nm]
  int64_t fed_;                 ///< time of the last setpoint
  int64_t next_heartbeat_, next_encoder_, next_torques_, next_telemetry_;
  uint32_t requested_ = 0;  ///< bit i: command i has been asked for
  int64_t rejected_ = 0;
  int64_t setpoints_ = 0;
};

/// One that is set up as the driver expects it.
std::unique_ptr<MotorDevice> MakeCanSimpleDevice(const MotorDescription& motor,
                                                 const DriverSettings& driver,
                                                 const VirtualRobotSettings& settings);

}  // namespace plumb
