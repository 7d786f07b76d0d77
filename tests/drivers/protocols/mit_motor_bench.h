#pragma once

#include "drivers/protocols/mit_device.h"
#include "drivers/protocols/mit_host.h"
#include "tests/drivers/protocols/motor_bench.h"

namespace plumb {

inline constexpr MitRanges kAk80{
    .position = 12.5, .velocity = 50, .torque = 18, .kp = 500, .kd = 5};

/// A MIT motor that has just been switched on, and heard.
struct MitMotorBench : MotorBench<MitDevice> {
  static constexpr int kNode = 0x11;
  static constexpr int kSilence = 200;  ///< [ms] that an armed one may not reach
  static constexpr int kStopFrames = 1;

  explicit MitMotorBench(uint8_t reply_length = mit::kWithTemperature)
      : MotorBench(MakeMitMotor(Describe(), {200'000}),
                   {.node = kNode, .master = 0x10, .ranges = kAk80, .reply_length = reply_length}) {
    Start(60);
  }

  static MotorDescription Describe(int node = kNode, int master = 0x10) {
    MotorDescription description;
    description.protocol = "mit";
    description.node = node;
    description.mit = MitDescription{master, kAk80, "a test"};
    return description;
  }
  static Frame Special(mit::Special special) { return mit::MakeSpecial(kNode, special); }
  static bool IsStop(const Frame& frame) { return SameOnWire(frame, Special(mit::kExit)); }
};

}  // namespace plumb
