#pragma once

#include <cstdint>
#include <vector>

#include "drivers/can/transport.h"

namespace plumb {

/// A motor's shaft, as its drive's encoder reads it.
struct ShaftReading {
  double turns = 0;
  double turns_per_second = 0;
};

/// The device's side of a motor protocol: a drive as a virtual robot has it. Pure logic: no
/// sockets, no clock, no motion. Times are scaled microseconds of one clock and do not decrease.
/// Not thread-safe.
class MotorDevice {
 public:
  virtual ~MotorDevice() = default;

  /// Frames that concern it.
  virtual std::vector<Filter> filters() const = 0;
  /// Obeys a frame; others' are ignored. @return true if the motion at this instant matters for
  /// that: an answer is due, or another torque.
  virtual bool OnFrame(const Frame& frame, int64_t now) = 0;
  /// Does what is due at `now`, while the shaft is like this.
  virtual void Tick(int64_t now, const ShaftReading& shaft, FrameBatch& out) = 0;
  /// When Tick next has something to do of its own accord.
  virtual int64_t NextDue() const = 0;
  /// [Nm] of the motor from the last OnFrame or Tick on.
  virtual double Torque() const = 0;
  /// Its power comes on.
  virtual void Boot(int64_t now) = 0;

  virtual bool armed() const = 0;
  /// Why it disarmed itself, as its protocol numbers it; 0 = it has not, or does not say.
  virtual uint32_t disarm_reason() const { return 0; }
  /// Frames for it that it could make nothing of.
  virtual int64_t rejected() const = 0;
};

}  // namespace plumb
