#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "drivers/can/transport.h"
#include "drivers/protocols/sensor_device.h"
#include "drivers/protocols/xsens.h"
#include "robot/description.h"

namespace plumb {

/// A virtual Xsens MTi that sends a sample per period, its messages in the order of their ids. Pure
/// logic, used like CanSimpleDevice; it listens to nothing. Not thread-safe. Does not allocate.
class XsensDevice {
 public:
  struct Settings {
    int base = 0;            ///< added to the factory's ids
    int64_t period = 5'000;  ///< [us] > 0
    int64_t tick = 100;      ///< [us] > 0 of SampleTime
    bool group_counter = false;
    uint32_t first_tick = 0;  ///< SampleTime when it starts
  };
  struct Sample {
    std::array<double, 3> rate{};                   ///< [rad/s]
    std::array<double, 3> force{};                  ///< [m/s^2]
    std::array<double, 4> orientation{1, 0, 0, 0};  ///< unit quaternion (w, x, y, z)
    uint32_t status = xsens::kOrientationValid;
  };

  /// @throws std::invalid_argument for a period or tick that is not positive.
  XsensDevice(const Settings& settings, int64_t now);

  void Tick(int64_t now, const Sample& sample, FrameBatch& out) noexcept;
  int64_t NextDue() const noexcept { return next_; }

  void Reboot(int64_t now) noexcept;
  /// Sends an Error message with the next Tick.
  void Error(int code) noexcept { error_ = code; }

 private:
  Settings settings_;
  int64_t started_, next_;
  uint16_t counter_ = 0;
  int error_ = 0;
};

/// One as described.
std::unique_ptr<SensorDevice> MakeXsensDevice(const SensorDescription& sensor);

}  // namespace plumb
