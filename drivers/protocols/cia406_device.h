#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "drivers/can/transport.h"
#include "drivers/protocols/cia406.h"
#include "drivers/protocols/sensor_device.h"
#include "robot/description.h"

namespace plumb {

/// A virtual CANopen absolute encoder: boot-up, NMT, heartbeat, TPDO1 on its event timer, which SDO
/// can change, emergency messages. Pure logic, used like CanSimpleDevice. No other SDO, no SYNC.
/// Not thread-safe. Does not allocate.
class Cia406Device {
 public:
  struct Settings {
    int node = 1;                        ///< [1, 127]
    double counts = 65536;               ///< per turn, >= 1
    double range = 65536;                ///< counts until it begins anew, 2 to 2^32
    int64_t event_timer = 10'000;        ///< [us] >= 1000
    int64_t heartbeat_period = 100'000;  ///< [us]; 0 = none
    bool refuses_timer = false;          ///< answers a write of the event timer with an abort
  };

  /// It boots at `now`. @throws std::invalid_argument for settings an encoder cannot have.
  Cia406Device(const Settings& settings, int64_t now);

  std::array<Filter, 2> filters() const;
  void OnFrame(const Frame& frame, int64_t now) noexcept;
  /// @param position [rad] of the shaft
  void Tick(int64_t now, double position, FrameBatch& out) noexcept;
  int64_t NextDue() const noexcept;

  void Reboot(int64_t now) noexcept;
  /// Sends an emergency message with the next Tick; 0 = error reset.
  void Emergency(int code) noexcept;
  bool operational() const noexcept { return state_ == cia406::kOperational; }
  int64_t rejected() const noexcept { return rejected_; }

 private:
  void OnSdo(const Frame& frame, int64_t now) noexcept;

  Settings settings_;
  cia406::NmtState state_ = cia406::kInPreOperational;
  bool boot_up_ = true, emergency_ = false;
  int error_ = 0;
  bool answer_due_ = false;
  Frame answer_;
  int64_t next_position_, next_heartbeat_;
  int64_t rejected_ = 0;
};

/// One as described.
std::unique_ptr<SensorDevice> MakeCia406Device(const SensorDescription& sensor);

}  // namespace plumb
