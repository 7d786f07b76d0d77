#pragma once

#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <random>
#include <string>

#include "drivers/driver/plausibility.h"
#include "drivers/protocols/cansimple_device.h"
#include "drivers/protocols/registry.h"
#include "sim/virtual/encoder.h"

namespace plumb {

/// A joint that is accelerated as hard as it can be, forwards and backwards, its virtual ODrive (14
/// bit), a bus, and the driver's side of both, in virtual time by milliseconds.
struct PlausibilityRig {
  struct Robot {
    double velocity_limit, acceleration;  ///< [rad/s], [rad/s^2]
    int64_t period, lateness;             ///< [us]
  };
  static constexpr Robot kPendulum{20, 100, 5'000, 50'000}, kHopper{100, 2'000, 2'000, 20'000};
  static constexpr double kResolution = 0.05, kTurn = 2 * std::numbers::pi;

  PlausibilityRig(const Robot& r, const std::string& faults, int64_t stuck_after = 100'000,
                  uint32_t seed = 1)
      : robot(r),
        device({.node = 1, .heartbeat_period = 100'000, .encoder_period = r.period}, now),
        motor(MakeMotor({.protocol = "cansimple", .node = 1}, {500'000})),
        robot_end(OpenTransport("loop:plausibility")),
        driver_end(OpenTransport(faults + "loop:plausibility")),
        watch({r.velocity_limit, 2, kResolution, r.period, r.lateness, stuck_after}),
        random(seed) {}

  /// One millisecond.
  void Step() {
    if (now >= turn_at) {
      acceleration = (random() % 2 == 0 ? 1 : -1) * robot.acceleration;
      turn_at = now + std::uniform_int_distribution<int64_t>(1'000, 400'000)(random);
    }
    if (still) acceleration = velocity = 0;
    if (std::abs(velocity + acceleration * 1e-3) > robot.velocity_limit)
      acceleration = -acceleration;
    const double next = velocity + acceleration * 1e-3;
    const double moved = (velocity + next) / 2 * 1e-3;
    encoder.Track({now, now + 1000, position / kTurn, (position + moved) / kTurn, velocity / kTurn,
                   next / kTurn});
    position += moved;
    velocity = next;
    now += 1000;

    FrameBatch batch;
    CanSimpleDevice::Sample sample{encoder.Quantise(position / kTurn), encoder.velocity()};
    if (change) change(sample);
    device.Tick(now, sample, batch);
    if (second) second->Tick(now, second_sample, batch);
    robot_end->SetTime(now);
    if (!batch.frames().empty()) robot_end->Send(batch.frames());
    driver_end->SetTime(now);
    std::array<Frame, 64> frames;
    const int count = driver_end->Receive(frames);
    for (int i = 0; i < count; ++i) {
      if (motor->OnFrame(frames[static_cast<size_t>(i)], now) != FrameUse::kEstimate) continue;
      ++estimates;
      watch.Add(now, motor->estimate().position, motor->estimate().velocity, effort);
    }
  }
  void Run(double seconds) {
    for (const int64_t end = now + std::llround(seconds * 1e6);
         now < end && watch.complaint().empty();)
      Step();
  }
  /// Whether something is found within the time. @return after how many estimates, -1 = not.
  int64_t Found(double seconds) {
    const int64_t before = estimates;
    Run(seconds);
    return watch.complaint().empty() ? -1 : estimates - before;
  }

  Robot robot;
  int64_t now = 5'000'000;
  CanSimpleDevice device;
  std::unique_ptr<Motor> motor;
  std::unique_ptr<Transport> robot_end, driver_end;
  Plausibility watch;
  std::minstd_rand random;
  Encoder encoder{14};
  double position = 0, velocity = 0, acceleration = 0;  ///< of the shaft [rad]
  int64_t turn_at = 0;
  bool still = false;
  double effort = 2;
  int64_t estimates = 0;
  std::function<void(CanSimpleDevice::Sample&)> change;  ///< the fault
  std::unique_ptr<CanSimpleDevice> second;
  CanSimpleDevice::Sample second_sample;
};

}  // namespace plumb
