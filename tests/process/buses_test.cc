// A bus with faults, and a recording, instead of a bus: with the real processes.

#include <fmt/format.h>

#include <fstream>

#include "tests/process/stage.h"

namespace plumb {
namespace {

using Catch::Contains;

/// As Stage::StartAll, the driver with a bus of its own.
void StartAll(Stage& stage, const std::string& drivers_bus) {
  stage.Start("plumb-robot", {"--bus", stage.bus_url, "--seed", "1"});
  stage.Start("plumb-driver", {"--bus", drivers_bus, "--virtual"});
  stage.Start("plumb-estimator");
  stage.Start("plumb-controller");
  REQUIRE(stage.WaitUntil([&] { return stage.controllers.received() > 0; }, 20));
}

TEST_CASE("on a bus that loses one frame in twenty, and delays all, the robot runs on") {
  Stage stage(70);
  StartAll(stage,
           "faulty:loss=0.05,delay=500us,jitter=1ms,duplicate=0.02,reorder=0.02:" + stage.bus_url);
  const bool begun = stage.BeginEpisode();
  INFO(stage.drivers.newest().reason << "; " << stage.controllers.newest().reason
                                     << int{stage.controllers.newest().phase});
  REQUIRE(begun);
  const bool stopped =
      stage.WaitUntil([&] { return stage.drivers.newest().state != driver_status_t::ARMED; }, 10);
  INFO(stage.drivers.newest().reason);
  CHECK_FALSE(stopped);
  CHECK(stage.drivers.newest().measurements_lost > 10);
}

TEST_CASE("on a bus that loses a third of the frames it runs, or stops and says why") {
  Stage stage(71);
  StartAll(stage, "faulty:loss=0.3:" + stage.bus_url);
  const bool moved = stage.BeginEpisode();
  const bool stopped =
      stage.WaitUntil([&] { return stage.drivers.newest().state == driver_status_t::FAULT; }, 2);
  CHECK((moved || stopped));
  CHECK(stage.children.at("plumb-driver")->running());
  if (stopped) {
    CHECK_FALSE(stage.drivers.newest().reason.empty());
    // Orders to stop are lost, too, and given again.
    CHECK(stage.WaitUntil([&] { return stage.axis_state == 1; }, 5));
    const int64_t last_torque = stage.last_torque_time;
    stage.Listen(0.5);
    CHECK(stage.last_torque_time == last_torque);
  }
}

TEST_CASE("with a recording for a bus the driver plays it and refuses to arm") {
  Stage stage(72);
  const std::filesystem::path log = stage.folder / "recording.log";
  {
    // Twenty seconds of a drive that says that it is armed.
    std::ofstream file(log);
    for (int i = 0; i < 4000; ++i) {
      file << fmt::format("({}.{:06}) can0 029#0000803E00000000\n", i / 200, i % 200 * 5000);
      if (i % 4 == 0)
        file << fmt::format("({}.{:06}) can0 021#0000000008000000\n", i / 200,
                            i % 200 * 5000 + 100);
    }
  }
  stage.Start("plumb-driver", {"--bus", "replay:" + log.string()});
  REQUIRE(stage.WaitUntil([&] { return stage.drivers.received() > 5; }, 10));
  CHECK_FALSE(stage.Arm(2));
  CHECK_THAT(stage.drivers.newest().reason, Contains("ARM refused") && Contains("recording"));
  CHECK(stage.drivers.newest().buses[0].frames_received > 100);
  CHECK(stage.drivers.newest().state != driver_status_t::ARMED);
}

}  // namespace
}  // namespace plumb
