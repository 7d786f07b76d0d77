#pragma once

#include <numbers>

#include "drivers/protocols/rmd_device.h"
#include "drivers/protocols/rmd_host.h"
#include "tests/drivers/protocols/motor_bench.h"

namespace plumb {

inline constexpr double kDegree = std::numbers::pi / 180;  ///< [rad]

/// An RMD motor that has just been switched on, and heard.
struct RmdMotorBench : MotorBench<RmdDevice> {
  static constexpr int kNode = 0x11;
  static constexpr int kSilence = 100;  ///< [ms] that an armed one may not reach
  static constexpr int kStopFrames = 2;
  static constexpr double kTorqueConstant = 0.9, kMostCurrent = 20;

  explicit RmdMotorBench(int64_t stored_watchdog = 0)
      : MotorBench(MakeRmdMotor(Describe(), {200'000}), {.node = kNode,
                                                         .torque_constant = kTorqueConstant,
                                                         .current = kMostCurrent,
                                                         .watchdog = stored_watchdog}) {
    device.Reboot(now, 0);
    Start(100);
  }

  static MotorDescription Describe(int node = kNode) {
    MotorDescription description;
    description.protocol = "rmd";
    description.node = node;
    description.rmd = RmdDescription{
        .torque_constant = kTorqueConstant, .current = kMostCurrent, .source = "test"};
    return description;
  }
  static Frame Command(rmd::Code code) { return rmd::MakeCommand(code, kNode); }
  static bool IsStop(const Frame& frame) {
    return frame.data[0] == rmd::kShutdown || frame.data[0] == rmd::kLockBrake;
  }
};

}  // namespace plumb
