#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "drivers/can/transport.h"

namespace plumb {

/// The motion at a sensor's place.
struct SensedMotion {
  double position = 0;                            ///< [rad] of an encoder's shaft
  std::array<double, 3> rate{};                   ///< [rad/s] of an IMU, in its axes
  std::array<double, 3> force{};                  ///< [m/s^2] specific force likewise
  std::array<double, 4> orientation{1, 0, 0, 0};  ///< its axes -> the world's: (w, x, y, z)
};

/// The device's side of a sensor protocol: a sensor as a virtual robot has it. As MotorDevice. Not
/// thread-safe.
class SensorDevice {
 public:
  virtual ~SensorDevice() = default;

  /// Frames that concern it.
  virtual std::vector<Filter> filters() const = 0;
  /// Obeys a frame; others' are ignored.
  virtual void OnFrame(const Frame& frame, int64_t now) = 0;
  /// Does what is due at `now`.
  virtual void Tick(int64_t now, const SensedMotion& motion, FrameBatch& out) = 0;
  /// When Tick next has something to do of its own accord.
  virtual int64_t NextDue() const = 0;
  /// Its power comes on.
  virtual void Boot(int64_t now) = 0;
  /// Frames for it that it could make nothing of.
  virtual int64_t rejected() const { return 0; }
};

}  // namespace plumb
