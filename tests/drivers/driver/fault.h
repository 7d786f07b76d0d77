#pragma once

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>

#include "tests/drivers/driver/bus_rig.h"

namespace plumb {

/// Something that goes wrong while the robot is armed and both drives produce torque, and what must
/// come of it.
///
/// With PLUMBLINE_FAULT_TABLE=1 in the environment each fault prints its row of the table in
/// docs/safety.md:
///
///   PLUMBLINE_FAULT_TABLE=1 drivers_test '[fault]' | grep '^|' | sort -t'|' -k2n -s
struct Fault {
  const char* number;     ///< in that table
  const char* name;       ///< of the fault
  const char* detection;  ///< by what the driver, or a drive, notices
  std::function<void(BusRig&)> happens;
  std::function<void(BusRig&)> is_over = [](BusRig&) {};  ///< and what else is to be seen by then
  const char* reason = "";  ///< DRIVER_STATUS says, from its beginning; "" if the robot runs on
  int8_t arm = driver_request_t::ARM;  ///< the request that leads back to normal
  /// [ms] until no torque is asked for or produced any more, at the latest
  int64_t within = 0;
  std::function<void(BusRig&)> prepare = [](BusRig&) {};  ///< before it starts

  void PrintRow(const std::string& reaction, const std::string& time) const {
    if (std::getenv("PLUMBLINE_FAULT_TABLE") == nullptr) return;
    std::printf("| %s | %s | %s | %s | %s |\n", number, name, detection, reaction.c_str(),
                time.c_str());
    std::fflush(stdout);
  }
};

/// Both drives are armed and produce 1 Nm; the driver's cycle and the drives' messages are `phase`
/// [ms] further.
inline void Bring(BusRig& rig, int64_t phase) {
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(100 + phase);
  for (const CanSimpleDevice& drive : rig.drives) REQUIRE(drive.Torque() == 1);
}

/// The robot is stopped in time in whatever phase of cycle and heartbeats the fault comes, says
/// why, and stays so until a person arms it after the fault is over.
inline void ExpectStop(const Fault& fault) {
  constexpr int64_t kPhases = 20;  // [ms] of a heartbeat
  int64_t worst = 0;
  std::string reason;
  for (int64_t phase = 0; phase < kPhases; ++phase) {
    BusRig rig;
    fault.prepare(rig);
    Bring(rig, phase);
    const int64_t begin = rig.now;
    fault.happens(rig);
    REQUIRE(rig.RunUntil(DriveState::kFault, 1000) >= 0);
    reason = rig.Reason();
    INFO("phase " << phase << ": " << reason);
    CHECK_FALSE(reason.empty());
    CHECK_THAT(reason, Catch::StartsWith(fault.reason));
    rig.Run(150);
    const int64_t took = (std::max(rig.torque_asked_for, rig.torque_produced) - begin) / 1000;
    CHECK(took <= fault.within);
    worst = std::max(worst, took);

    // For one phase, what comes after.
    if (phase != 0) continue;
    rig.Run(1000);
    CHECK(rig.Reason() == reason);
    fault.is_over(rig);
    rig.Run(1000);
    CHECK(rig.driver->state() == DriveState::kFault);
    CHECK(rig.driver->confirmed_idle());
    CHECK((std::max(rig.torque_asked_for, rig.torque_produced) - begin) / 1000 == took);
    CHECK(rig.Arm(1, fault.arm));
    rig.Run(50);
    for (const CanSimpleDevice& drive : rig.drives) CHECK(drive.Torque() == 1);
  }
  fault.PrintRow("stops: " + reason, fmt::format("{} ms", worst));
}

/// The robot goes on as if nothing were. `within` is the greatest age [ms] of a torque that a drive
/// produces, from the time it was commanded.
inline void ExpectToRunOn(const Fault& fault) {
  constexpr double kStep = 0.001;  // [Nm] more in each cycle: a torque tells when it was commanded
  int64_t oldest = 0;
  for (int64_t phase = 0; phase < 20; ++phase) {
    BusRig rig;
    Bring(rig, phase);
    rig.each_millisecond.push_back([&] {
      if (rig.now % 5000 == rig.cycle_phase) rig.effort += kStep;
      for (const CanSimpleDevice& drive : rig.drives) {
        const auto age = std::llround((rig.effort - drive.Torque()) / kStep) * 5;
        oldest = std::max<int64_t>(oldest, age);
      }
    });
    fault.happens(rig);
    rig.Run(500);
    INFO("phase " << phase << ": " << rig.Reason());
    CHECK(rig.driver->state() == DriveState::kArmed);
    CHECK(oldest <= fault.within);
    fault.is_over(rig);
  }
  fault.PrintRow("runs on", fmt::format("a torque is at most {} ms old", oldest));
}

}  // namespace plumb
