#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "drivers/can/transport.h"
#include "drivers/protocols/motor_device.h"
#include "drivers/protocols/rmd.h"
#include "robot/description.h"

namespace plumb {

/// A virtual RMD motor, its traps included:
///  - a setpoint is all that it takes to run, unless the brake is locked, as it is when the power
///    comes on, or an error is reported;
///  - without a frame for the watchdog's time it shuts down, locks the brake and says so, then and
///    each second; the next command is echoed and not obeyed, those after it are, as if nothing had
///    happened;
///  - numbers are cut off towards zero, as integers are made of them in C;
///  - the brake is a word: the shaft moves with it locked, but without torque.
/// Pure logic, used like CanSimpleDevice. Not thread-safe. Does not allocate.
class RmdDevice {
 public:
  struct Settings {
    int node = 1;                ///< [1, 32]
    double torque_constant = 1;  ///< [Nm/A] > 0
    double current = 20;         ///< [A] > 0 the greatest that it gives
    int64_t watchdog = 0;        ///< [us] >= 0 as stored in it, in whole milliseconds; 0 = off
    double bus_voltage = 48;     ///< [V]
    double temperature = 25;     ///< [degC]
  };
  struct Sample {
    double position = 0;  ///< [rad] of the output shaft
    double velocity = 0;  ///< [rad/s]
  };

  /// @throws std::invalid_argument for a node or a number that it cannot have.
  explicit RmdDevice(const Settings& settings);

  std::array<Filter, 2> filters() const;

  /// Obeys a frame; others' are ignored. The answer waits for the next Tick. @return whether there
  /// will be one.
  bool OnFrame(const Frame& frame, int64_t now) noexcept;
  /// Brings the motor to `now`: answers, then the watchdog.
  void Tick(int64_t now, const Sample& sample, FrameBatch& out) noexcept;
  /// The next instant at which Tick has something to do of its own accord.
  int64_t NextDue() const noexcept;

  /// [Nm] the motor produces now.
  double Torque() const noexcept;

  bool armed() const noexcept { return running_; }  ///< under control of its current
  bool interrupted() const noexcept { return interrupted_; }
  int64_t watchdog() const noexcept { return watchdog_; }   ///< [us] as stored
  int watchdog_writes() const noexcept { return writes_; }  ///< each wears its flash
  bool brake_released() const noexcept { return brake_released_; }
  int64_t rejected() const noexcept { return rejected_; }
  /// Errors also shut it down.
  void set_errors(uint16_t errors) noexcept;
  /// Power lost and back; the position then counts from there [rad]. What it has stored it keeps.
  void Reboot(int64_t now, double position) noexcept;

 private:
  struct Answer {
    std::array<uint8_t, 8> command;
    bool echo;
  };

  void CheckWatchdog(int64_t now) noexcept;
  bool Obey(const Frame& frame, int64_t now) noexcept;
  void Shutdown() noexcept;
  Frame Reply(const Answer& answer, const Sample& sample, int64_t now) const noexcept;

  Settings settings_;
  int64_t watchdog_;
  int writes_ = 0;
  bool running_ = false, brake_released_ = false, interrupted_ = false;
  double current_ = 0;  ///< [A] of the last setpoint
  uint16_t errors_ = 0;
  double zero_ = 0;  ///< [rad] taken from positions
  int64_t booted_ = 0, fed_ = 0;
  int64_t next_warning_ = 0;  ///< while it is interrupted
  std::array<Answer, 16> due_{};
  size_t due_count_ = 0;
  int64_t rejected_ = 0;
};

/// One that is set up as the driver expects it.
/// @throws std::invalid_argument if it has no torque constant, or settings that it cannot have.
std::unique_ptr<MotorDevice> MakeRmdDevice(const MotorDescription& motor,
                                           const DriverSettings& driver,
                                           const VirtualRobotSettings& settings);

}  // namespace plumb
