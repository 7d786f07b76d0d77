#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "drivers/can/transport.h"
#include "drivers/protocols/moteus.h"
#include "drivers/protocols/moteus_subframes.h"
#include "drivers/protocols/motor_device.h"
#include "robot/description.h"

namespace plumb {

/// A virtual moteus, as far as the driver has need of it, its traps included:
///  - a frame is a row of subframes, obeyed until one is not understood; what it answers is made of
///    them likewise, in the number formats that were asked for;
///  - writing the mode sets the rest of the command back to its defaults, full gains among them;
///  - without a command in position mode for its timeout it is in kTimedOut, does there what
///    `timeout_mode` says, and obeys "stop" alone; questions are no commands;
///  - from a fault, too, only "stop" leads back; on the way from stopped to position mode it is
///    kPreparing for some milliseconds;
///  - an answer that has not been sent is dropped for the next one;
///  - positions are in single precision, and begin anew where its power comes on.
/// Pure logic, used like CanSimpleDevice. Not thread-safe.
class MoteusDevice {
 public:
  struct Settings {
    int node = 1;                       ///< [1, 126]
    int timeout_mode = 0;               ///< servo.timeout_mode: kStopped or kZeroVelocity
    int64_t default_timeout = 100'000;  ///< [us] servo.default_timeout_s; 0 = for ever
    double most_torque = 10;            ///< [Nm] > 0 that its current is good for
    double kp = 4, kd = 0.05;           ///< [Nm/turn], [Nm s/turn] servo.pid_position, as delivered
    double timeout_torque = 5;          ///< [Nm] servo.timeout_max_torque_Nm, as delivered
    double bus_voltage = 24;            ///< [V]
    double temperature = 25;            ///< [degC] of the board
    int register_map = moteus::kKnownMap;
  };
  struct Sample {
    double position = 0;  ///< [rad] of the output shaft
    double velocity = 0;  ///< [rad/s]
  };

  /// @throws std::invalid_argument for a node or a number that it cannot have.
  explicit MoteusDevice(const Settings& settings);

  std::array<Filter, 3> filters() const;

  /// Obeys a frame; others' are ignored. The answer waits for the next Tick. @return whether there
  /// will be one, or another torque.
  bool OnFrame(const Frame& frame, int64_t now) noexcept;
  /// Brings the motor to `now`: the answer, then the watchdog.
  void Tick(int64_t now, const Sample& sample, FrameBatch& out) noexcept;
  /// The next instant at which Tick has something to do of its own accord.
  int64_t NextDue() const noexcept;

  /// [Nm] the motor produces now.
  double Torque(const Sample& sample) const noexcept;

  bool armed() const noexcept { return mode_ == moteus::kPositionMode; }
  int mode() const noexcept { return mode_; }
  int fault() const noexcept { return fault_; }
  const moteus::Setpoint& setpoint() const noexcept { return command_; }
  int64_t rejected() const noexcept { return rejected_; }  ///< frames not understood to their end
  void set_fault(int fault) noexcept;                      ///< 0 leaves it in the mode it is in
  void set_thermistor(double temperature) noexcept { motor_temperature_ = temperature; }
  /// Power lost and back; the position then counts from there [rad]. What it has stored it keeps.
  void Reboot(int64_t now, double position) noexcept;

 private:
  bool Concerns(const Frame& frame) const noexcept;
  bool Obey(moteus::SubframeReader& reader) noexcept;
  void Write(uint32_t target, double value) noexcept;
  std::optional<double> Read(uint32_t source, const Sample& sample, int64_t now) const noexcept;
  void Begin(int64_t now) noexcept;
  void CheckTime(int64_t now) noexcept;
  void Say(size_t most, moteus::SubframeWriter& writer) noexcept;
  bool Reply(uint32_t subframe, const moteus::SubframeReader::Registers& registers,
             const Sample& sample, int64_t now, moteus::SubframeWriter& writer) const noexcept;
  void ReplyToAll(const Sample& sample, int64_t now, moteus::SubframeWriter& writer) noexcept;
  Frame Answer(const Sample& sample, int64_t now) noexcept;

  Settings settings_;
  int mode_ = moteus::kStopped, fault_ = 0;
  moteus::Setpoint command_;
  int wish_ = -1;         ///< mode written by the frame at hand; -1 = none
  int64_t prepared_ = 0;  ///< [us] when it has prepared itself
  int64_t until_ = 0;     ///< [us] for which the command holds
  double zero_ = 0;       ///< [rad] taken from positions
  double motor_temperature_ = 0;
  int64_t booted_ = 0;
  bool due_ = false;
  Frame question_;            ///< what is to be answered
  std::string heard_, text_;  ///< of the console: what it has been told, what it has to say
  int64_t rejected_ = 0;
};

/// One that is set up as the driver expects it: servo.timeout_mode 0. Its gains, if somebody gives
/// it any, act on the motion at its last Tick.
/// @throws std::invalid_argument if it has no torque, or settings that it cannot have.
std::unique_ptr<MotorDevice> MakeMoteusDevice(const MotorDescription& motor,
                                              const DriverSettings& driver,
                                              const VirtualRobotSettings& settings);

}  // namespace plumb
