#include "drivers/driver/driver.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <numbers>

#include "tests/drivers/driver/rig.h"

namespace plumb {
namespace {

using Catch::Matchers::Contains;
using Catch::Matchers::StartsWith;

constexpr double kTwoPi = 2 * std::numbers::pi;

TEST_CASE("JOINT_STATE comes once per measurement, with regular times and the effort that acted") {
  Rig rig(2);
  rig.cycle_phase = 2000;
  rig.Start();
  int64_t step = 0;
  rig.on_step = [&] {
    ++step;
    rig.effort = std::sin(0.013 * static_cast<double>(step));
    for (size_t i = 0; i < 2; ++i)
      rig.samples[i] = {0.001 * static_cast<double>(step) / kTwoPi, 1.0 / kTwoPi};
  };
  REQUIRE(rig.Arm());
  // The setpoints and their times, as the receiver notes them.
  struct Setpoint {
    int64_t utime;
    double effort;
  };
  std::vector<Setpoint> setpoints;
  rig.to_drive = [&](Frame& frame) {
    const auto values = DecodePayload(cansimple::kSetInputTorque, frame);
    if (frame.id == 0x4E) setpoints.push_back({rig.utime(), (*values)[0]});
    return true;
  };
  rig.Run(50);
  rig.states.clear();
  rig.Run(1000);
  REQUIRE(rig.states.size() == 200);
  for (size_t i = 0; i < rig.states.size(); ++i) {
    const joint_state_t& state = rig.states[i];
    CHECK(state.num_joints == 2);
    CHECK(state.valid[1]);
    CHECK(state.velocity[1] == Approx(1));
    CHECK(std::isnan(state.effort_measured[0]));
    if (i == 0) continue;
    CHECK(state.sequence == rig.states[i - 1].sequence + 1);
    const int64_t from = rig.states[i - 1].utime, to = state.utime;
    CHECK(to - from == Approx(5000).margin(2));
    double integral = 0;
    for (size_t k = 0; k < setpoints.size(); ++k) {
      const int64_t begin = std::max(from, setpoints[k].utime);
      const int64_t end = std::min(to, k + 1 < setpoints.size() ? setpoints[k + 1].utime : to);
      if (end > begin) integral += setpoints[k].effort * static_cast<double>(end - begin);
    }
    CHECK(state.effort_applied[1] ==
          Approx(integral / static_cast<double>(to - from)).margin(1e-6));
  }
}

TEST_CASE("an effort acts as much later than it was sent as its frame is on its way") {
  Rig rig;
  rig.robot.driver.effort_delay = 0.002;
  rig.cycle_phase = 1000;  // commands follow the measurements by 1 ms
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(50);
  rig.states.clear();
  rig.effort = -1;
  rig.Run(20);
  const auto first = std::ranges::find_if(
      rig.states, [](const joint_state_t& state) { return state.effort_applied[0] != 1; });
  REQUIRE(first != rig.states.end());
  REQUIRE(first != rig.states.begin());
  // Between two measurements, 5 ms apart, it was 1 for 3 ms and -1 for 2 ms.
  CHECK(first->effort_applied[0] == Approx((3 * 1 - 2 * 1) / 5.0));
  CHECK(first->effort_sent[0] == -1);
  CHECK(std::prev(first)->effort_sent[0] == 1);
  CHECK(std::next(first)->effort_applied[0] == Approx(-1));
}

TEST_CASE("the first JOINT_STATE has no effort applied, idle ones have zero") {
  Rig rig;
  rig.Start();
  rig.Run(50);
  REQUIRE(rig.states.size() == 10);
  CHECK(std::isnan(rig.states[0].effort_applied[0]));
  CHECK(rig.states.back().effort_applied[0] == 0);
  CHECK(rig.states.back().effort_sent[0] == 0);
}

TEST_CASE("when the clock is set back, measurements go on from there") {
  Rig rig(2);
  rig.cycle_phase = 2000;
  rig.Start();
  rig.Run(500);
  REQUIRE(rig.states.size() == 100);
  rig.states.clear();
  rig.set_back = GENERATE(int64_t{20'000}, int64_t{400'000}, int64_t{3'600'000'000});
  rig.Run(500);
  CHECK(rig.states.size() >= 98);
  int unknown = 0;
  for (size_t i = 0; i < rig.states.size(); ++i) {
    const joint_state_t& state = rig.states[i];
    INFO("back " << rig.set_back << " i " << i << " utime " << state.utime - Rig::kEpoch);
    if (std::isnan(state.effort_applied[0])) {
      ++unknown;
      continue;
    }
    CHECK(state.utime - rig.states[i - 1].utime == Approx(5000).margin(20));
  }
  CHECK(unknown >= 1);
  CHECK(unknown <= 2);
  CHECK(rig.Status().measurements_lost >= 1);
}

TEST_CASE("estimates that were lost are counted") {
  Rig rig(2);
  int count = 0;
  rig.to_driver = [&](Frame& frame) { return frame.id != 0x49 || ++count % 20 != 0; };
  rig.Start();
  rig.Run(1000);
  // Each lost one, and its partner that is left alone.
  CHECK(rig.Status().measurements_lost >= 2 * 9);
  CHECK(rig.Status().measurements_lost <= 2 * 10);
}

TEST_CASE("an effort that the bus did not accept was not applied") {
  Rig rig;
  rig.settings.watchdog = 0;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(50);
  rig.bus_full = true;
  rig.effort = -1;
  rig.Run(20);
  CHECK(rig.states.back().effort_sent[0] == 1);
  CHECK(rig.states.back().effort_applied[0] == Approx(1));
  rig.bus_full = false;
  rig.Run(20);
  CHECK(rig.states.back().effort_applied[0] == Approx(-1));
}

TEST_CASE("torques that the drive reports reach the message at the joint's side") {
  Rig rig;
  rig.settings.torques_period = 5'000;
  rig.robot.joints[0].motor.gear = 2;
  rig.Start();
  REQUIRE(rig.Arm(1));
  rig.Run(50);
  CHECK(rig.states.back().effort_measured[0] == Approx(1));
}

TEST_CASE("the status message counts") {
  Rig rig;
  rig.Start();
  rig.stats = {.received = 0, .sent = 70, .refused = 3, .malformed = 4, .lost = 5, .echoes = 6};
  rig.lateness = 3;
  rig.Run(50);
  rig.lateness = 6000;
  rig.Run(5);
  const driver_status_t& status = rig.Status();
  CHECK(status.state == driver_status_t::IDLE);
  CHECK(status.joint_name == std::vector<std::string>{"pivot"});
  CHECK(status.buses[0].frames_sent == 70);
  CHECK(status.buses[0].frames_dropped == 8);
  CHECK(status.buses[0].frames_rejected == 4);
  CHECK(status.buses[0].frames_received == 11 + 2);  // estimates, heartbeats
  CHECK(status.cycles == 11);
  CHECK(status.overruns == 1);
  CHECK(status.num_bins == static_cast<int32_t>(status.lateness.size()));
  CHECK(status.lateness[1] == 10);
  CHECK(status.lateness[12] == 1);
  std::vector<uint8_t> buffer(static_cast<size_t>(status.getEncodedSize()));
  CHECK(status.encode(buffer.data(), 0, static_cast<int>(buffer.size())) ==
        static_cast<int>(buffer.size()));
}

TEST_CASE("robots it cannot drive") {
  Rig rig(2);
  rig.robot.joints[1].motor.node = 1;
  CHECK_THROWS_WITH(rig.Start(), Contains("'pivot'") && Contains("'knee1'"));
  rig.robot.joints[1].motor = {.protocol = "telepathy", .node = 2};
  CHECK_THROWS_WITH(rig.Start(), Contains("telepathy") && Contains("cansimple"));
  rig.robot.joints[1].motor = {.protocol = "cansimple", .node = 63};
  CHECK_THROWS_WITH(rig.Start(), Contains("63"));
}

TEST_CASE("temperatures and supplies are asked for, one at a time") {
  Rig rig(2);
  rig.Start();
  CHECK(std::isnan(rig.Status().motor_temperature[0]));
  CHECK(std::isnan(rig.Status().bus_current[0]));
  REQUIRE(rig.Arm(1));
  std::map<std::string, int> asked;
  for (int i = 0; i < 200; ++i) {
    rig.Run(5);
    int questions = 0;
    for (const std::string& text : rig.Sent()) {
      if (!text.ends_with("#R")) continue;
      ++questions;
      ++asked[text];
    }
    CHECK(questions <= 1);
  }
  CHECK(asked ==
        std::map<std::string, int>{{"035#R", 10}, {"037#R", 10}, {"055#R", 10}, {"057#R", 10}});
  for (size_t i = 0; i < 2; ++i) {
    CHECK(rig.Status().motor_temperature[i] == 25);
    CHECK(rig.Status().drive_temperature[i] == 25);
    CHECK(rig.Status().bus_voltage[i] == 24);
    CHECK(rig.Status().bus_current[i] == 0);
    CHECK_THAT(rig.Status().drive_identity[i], StartsWith("firmware 0.6."));
  }
  CHECK(rig.Status().setpoints_saturated == 0);
}

}  // namespace
}  // namespace plumb
