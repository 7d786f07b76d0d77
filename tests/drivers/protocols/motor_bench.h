#pragma once

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "drivers/protocols/motor.h"

namespace plumb {

/// The host's side of a protocol and its virtual motor (`Device`) against each other, a millisecond
/// at a time in virtual time. The driver's part is played here: zero torque while arming, `torque`
/// when armed, and a reading asked for every 25 ms.
template <typename Device>
struct MotorBench {
  MotorBench(std::unique_ptr<Motor> host, const typename Device::Settings& settings)
      : motor(std::move(host)), device(settings) {}

  /// Until the motor is heard, and some milliseconds more.
  void Start(int milliseconds) {
    while (motor->state() == DriveState::kAbsent && now < 1'200'000) Step();
    Run(milliseconds);
  }
  void Step() {
    now += 1000;
    sample.position += sample.velocity * 1e-3;
    FrameBatch frames, answers;
    if (driving) Drive(frames);
    motor->Transmitted(!bus_full, now);
    if (!bus_full) {
      for (const Frame& frame : frames.frames()) {
        sent.push_back(frame);
        if (powered && (!to_device || to_device(frame))) device.OnFrame(frame, now);
        applied = std::max(applied, std::abs(DeviceTorque()));
      }
    }
    device.Tick(now, sample, answers);
    if (!powered) return;
    for (const Frame& frame : answers.frames()) {
      if (to_host && !to_host(frame)) continue;
      if (motor->OnFrame(frame, now) == FrameUse::kEstimate) ++estimates;
    }
  }
  void Run(int milliseconds) {
    for (int i = 0; i < milliseconds; ++i) Step();
  }
  bool Arm() {
    motor->Arm(now);
    for (int i = 0; i < 100 && motor->state() != DriveState::kArmed; ++i) Step();
    return motor->state() == DriveState::kArmed;
  }
  /// How often this has been sent.
  int Count(const Frame& like) const {
    return static_cast<int>(
        std::ranges::count_if(sent, [&](const Frame& frame) { return SameOnWire(frame, like); }));
  }

  std::unique_ptr<Motor> motor;
  Device device;
  typename Device::Sample sample{1, 0};
  int64_t now = 1'000'000;
  bool driving = true;    ///< false: the driver is silent
  bool setpoints = true;  ///< false: it gives no torques, but all else
  bool powered = true;    ///< false: the motor hears nothing and says nothing
  bool bus_full = false;
  double torque = 0;
  double applied = 0;  ///< [Nm] the greatest that the motor has produced
  int estimates = 0;
  std::function<bool(const Frame&)> to_device, to_host;  ///< if any: whether a frame gets there
  std::vector<Frame> sent;

 private:
  void Drive(FrameBatch& frames) {
    const DriveState state = motor->state();
    if (setpoints && (state == DriveState::kArming || state == DriveState::kArmed))
      frames.Push(motor->Torque(state == DriveState::kArmed ? torque : 0));
    motor->Tick(now, true, frames);
    if (state != DriveState::kArming && now % 25'000 == 0) motor->Poll(frames);
  }
  double DeviceTorque() const {
    if constexpr (requires { device.Torque(sample); }) {
      return device.Torque(sample);  // with gains, it depends on the motion
    } else {
      return device.Torque();
    }
  }
};

/// The motor still runs and does not count as idle; 60 ms later it has been stopped, and does.
template <typename Device>
void CheckIdleOnlyOnceStopped(MotorBench<Device>& bench) {
  CHECK(bench.device.armed());
  CHECK_FALSE(bench.motor->confirmed_idle());
  bench.Run(60);
  CHECK_FALSE(bench.device.armed());
  CHECK(bench.motor->confirmed_idle());
}

}  // namespace plumb
