#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "common/special_numbers.h"
#include "drivers/can/transport.h"
#include "drivers/protocols/bus_device.h"
#include "drivers/protocols/motor.h"
#include "robot/description.h"

namespace plumb {

/// How a sensor is.
enum class SensorState : int8_t {
  kAbsent = 0,    ///< nothing valid heard lately
  kStarting = 1,  ///< it is there, and being told to send
  kRunning = 2,   ///< readings come
  kFault = 3,     ///< it failed, and stays so until Start
};

/// Of an encoder, at its shaft. Turns are counted from the first reading after Start, which is
/// within half a turn (or half the turns that it can tell apart) of 0.
struct EncoderReading {
  double position = 0;     ///< [rad]
  double velocity = kNaN;  ///< [rad/s]; NaN if it reports none
};

/// Of an inertial measurement unit, in its own axes, all of one instant.
struct ImuSample {
  int64_t sample_time = 0;        ///< [us] by the sensor's clock, which counts from anywhere
  std::array<double, 3> rate{};   ///< [rad/s] angular velocity
  std::array<double, 3> force{};  ///< [m/s^2] specific force: +9.81 upwards at rest
  /// unit quaternion (w, x, y, z): its axes -> the world's, z up
  std::array<double, 4> orientation{};
  bool orientation_valid = false;  ///< the sensor's filter trusts the orientation
  /// it was beyond what it can measure
  bool rate_clipped = false, force_clipped = false;
};

/// A sensor's verdict on a frame.
enum class SensorUse {
  kNotMine,   ///< another id, or not a frame a sensor sends: remote, extended, FD, error
  kRejected,  ///< its id, but too short or impossible
  kConsumed,
  kReading,  ///< completed a new reading
};

/// The driver's side of one sensor: what a protocol must offer. Pure logic, as Motor: no sockets,
/// no clock; all methods but the constructor and filters() are free of exceptions and allocation;
/// times are scaled monotonic microseconds. Frames to send go into a batch. Not thread-safe.
class Sensor {
 public:
  virtual ~Sensor() = default;

  /// Ids of the frames this sensor sends.
  virtual std::vector<Filter> filters() const = 0;

  virtual SensorUse OnFrame(const Frame& frame, int64_t now) noexcept = 0;

  /// Begins anew: forgets a fault. A sensor that was just made starts by itself.
  virtual void Start(int64_t now) noexcept = 0;
  /// Once per cycle: deadlines, and frames that make it send.
  virtual void Tick(int64_t now, FrameBatch& out) noexcept = 0;

  /// As Motor::Displaced.
  virtual void Displaced() noexcept {}

  virtual SensorState state() const noexcept = 0;
  /// Why it is not running; empty if it is.
  virtual std::string_view reason() const noexcept = 0;
  /// Readings that were thrown away because a part of them was missing, since it was made.
  virtual int64_t incomplete() const noexcept { return 0; }

  /// The newest reading, also of one that is not running any more; null of a sensor of another
  /// kind.
  virtual const EncoderReading* encoder() const noexcept { return nullptr; }
  virtual const ImuSample* imu() const noexcept { return nullptr; }
};

/// The driver's settings that concern a sensor.
struct SensorTiming {
  int64_t timeout = 0;  ///< [us] > 0 silence after which a sensor counts as absent
};

}  // namespace plumb
