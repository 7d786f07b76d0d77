#pragma once

#include "drivers/protocols/moteus_device.h"
#include "drivers/protocols/moteus_host.h"
#include "tests/drivers/protocols/motor_bench.h"

namespace plumb {

/// A moteus that has just been switched on, and heard.
struct MoteusMotorBench : MotorBench<MoteusDevice> {
  static constexpr int kNode = 0x11;
  static constexpr int kSilence = 100;  ///< [ms] that an armed one may not reach
  static constexpr int kStopFrames = 1;
  static constexpr double kMostTorque = 20;

  explicit MoteusMotorBench(MoteusDevice::Settings settings = {})
      : MotorBench(MakeMoteusMotor(Describe(), {200'000}), Set(settings)) {
    device.Reboot(now, 0);
    Start(100);
  }

  static MoteusDevice::Settings Set(MoteusDevice::Settings settings) {
    settings.node = kNode;
    settings.most_torque = kMostTorque;
    return settings;
  }
  static MotorDescription Describe(int node = kNode) {
    MotorDescription description;
    description.protocol = "moteus";
    description.node = node;
    description.moteus = MoteusDescription{.torque = kMostTorque, .watchdog = 0.1};
    return description;
  }
  static bool IsCommand(const Frame& frame) { return HasShape(moteus::kCommand, frame); }
  static bool IsStop(const Frame& frame) { return SameOnWire(frame, moteus::MakeStop(kNode)); }
};

}  // namespace plumb
