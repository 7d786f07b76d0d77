#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "drivers/can/transport.h"
#include "drivers/protocols/mit.h"
#include "drivers/protocols/motor_device.h"
#include "robot/description.h"

namespace plumb {

/// A virtual motor that speaks the MIT mini-cheetah protocol as bgkatz' firmware does, its traps
/// included:
///  - a command is remembered in rest mode, too, and obeyed as soon as the motor is switched on;
///  - without a command for `watchdog` its gains and torque become zero, but it stays switched on;
///    special frames do not count as commands;
///  - the reply to a frame is what was before that frame, and the position in it goes round;
///  - codes are truncated in single precision, not rounded.
/// Pure logic, used like CanSimpleDevice. Not thread-safe. Does not allocate.
class MitDevice {
 public:
  struct Settings {
    int node = 1;    ///< [1, 0xFF]
    int master = 0;  ///< [0, 0x7FF] id of the replies
    MitRanges ranges;
    uint8_t reply_length = mit::kWithVoltage;  ///< a mit::ReplyLength
    int64_t watchdog = 25'000;                 ///< [us]; 0 = off
    double bus_voltage = 24;                   ///< [V]
    double temperature = 25;                   ///< [degC]
  };
  struct Sample {
    double position = 0;  ///< [rad] of the output shaft
    double velocity = 0;  ///< [rad/s]
  };

  /// @throws std::invalid_argument for a node, id, length or range that it cannot have.
  explicit MitDevice(const Settings& settings);

  Filter filter() const { return {.id = static_cast<uint32_t>(settings_.node)}; }

  /// Obeys a frame; others' are ignored. The reply waits for the next Tick.
  void OnFrame(const Frame& frame, int64_t now) noexcept;
  /// Brings the motor to `now`: the watchdog, then replies.
  void Tick(int64_t now, const Sample& sample, FrameBatch& out) noexcept;
  /// The next instant at which Tick has something to do of its own accord.
  int64_t NextDue() const noexcept;

  /// [Nm] the motor produces now.
  double Torque(const Sample& sample) const noexcept;

  bool armed() const noexcept { return armed_; }
  const mit::Setpoint& setpoint() const noexcept { return setpoint_; }
  int zeroed() const noexcept { return zeroed_; }  ///< times its position was made 0
  int64_t rejected() const noexcept { return rejected_; }
  void set_error(mit::Error error) noexcept { error_ = error; }  ///< an error also switches it off
  /// power lost and back; the position then counts from there [rad]
  void Reboot(double position) noexcept;

 private:
  Frame Reply(const Sample& sample, double torque) const noexcept;
  void CheckWatchdog(int64_t now) noexcept;

  Settings settings_;
  Layout command_, reply_;
  bool armed_ = false;
  mit::Setpoint setpoint_;
  mit::Error error_ = mit::kNoError;
  double zero_ = 0;  ///< [rad] taken from positions
  bool make_zero_ = false;
  int64_t fed_ = 0;                   ///< time of the last command, or of being switched on
  std::array<mit::Setpoint, 8> due_;  ///< replies not yet sent: what was obeyed then
  size_t due_count_ = 0;
  int zeroed_ = 0;
  int64_t rejected_ = 0;
};

/// One that is set up as the driver expects it. Its gains, if somebody gives it any, act on the
/// motion at its last Tick.
/// @throws std::invalid_argument if it has no ranges, or settings that it cannot have.
std::unique_ptr<MotorDevice> MakeMitDevice(const MotorDescription& motor,
                                           const DriverSettings& driver,
                                           const VirtualRobotSettings& settings);

}  // namespace plumb
