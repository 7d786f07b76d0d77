#include "calibrator/motion/table_units.h"

#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/calibrator/motion/csv_tables.h"

namespace plumb {
namespace {

constexpr double kDegrees = 180 / 3.14159265358979;

RobotDescription LimitedPendulum() {
  RobotDescription robot = GymPendulum();
  robot.joints[0].type = JointDescription::Type::kRevolute;
  robot.joints[0].lower = -1.5, robot.joints[0].upper = 1.5;
  return robot;
}

// A swing within the limits, its numbers in other units.
std::string SwingingTable(double position, double velocity, double action, double time = 1) {
  std::string csv = "t,q/pivot,v/pivot,u/pivot\n";
  for (int k = 0; k < 100; ++k) {
    const double phase = 0.3 * k;
    csv += fmt::format("{},{},{},{}\n", time * 0.05 * k, position * std::sin(phase),
                       velocity * 6 * std::cos(phase), action * 1.9 * std::sin(2.1 * k));
  }
  return csv;
}

TEST_CASE("a table in the robot's units is asked nothing, nor one a little beyond the limits") {
  CHECK(ReadTable(SwingingTable(1, 1, 1), LimitedPendulum()).warnings.empty());
  CHECK(ReadTable(SwingingTable(2, 3, 1), LimitedPendulum()).warnings.empty());
  CHECK(ReadTable(SwingingTable(kDegrees, 1, 1)).warnings.empty());  // it has no limits
}

TEST_CASE("angles and speeds in degrees are asked about") {
  const auto warnings = ReadTable(SwingingTable(kDegrees, kDegrees, 1), LimitedPendulum()).warnings;
  REQUIRE(warnings.size() == 2);
  CHECK_THAT(warnings[0], Catch::StartsWith("far beyond the joint's limits: q/pivot in 9") &&
                              Catch::EndsWith(" % of the rows: degrees?"));
  CHECK_THAT(warnings[1], Catch::StartsWith("beyond the joint's speed limit: v/pivot in 9") &&
                              Catch::EndsWith(" % of the rows: degrees per second?"));
}

TEST_CASE("a slide is asked about millimetres") {
  RobotDescription robot = Robot("cartpole");
  robot.simulation.latency = 0;
  std::string csv = "t,q/cart,q/hinge,v/cart,v/hinge,u/cart\n";
  for (int k = 0; k < 100; ++k)
    csv += fmt::format("{},{},{},1,{},0\n", 0.02 * k, 1000 * std::sin(0.3 * k), k, std::cos(k));
  const auto warnings = ReadTable(csv, robot).warnings;
  REQUIRE(warnings.size() == 2);
  CHECK(warnings[0] == "the same in all rows: v/cart");
  CHECK_THAT(warnings[1], Catch::StartsWith("far beyond the joint's limits: q/cart in ") &&
                              Catch::EndsWith(": millimetres?"));
}

TEST_CASE("actions that are nearly all clipped are asked about, joint by joint") {
  const auto warnings = ReadTable(SwingingTable(1, 1, 1000), LimitedPendulum()).warnings;
  REQUIRE(warnings.size() == 2);
  CHECK(warnings[0].find(" actions go beyond the effort limits: clipped") != std::string::npos);
  CHECK_THAT(warnings[1], Catch::StartsWith("u/pivot: ") &&
                              Catch::EndsWith(" of 100 are beyond the effort limit: mNm?"));
  const RobotDescription hopper = Robot("hopper/gym.toml");
  CHECK(AskActionUnit("u/thigh", hopper.joints[3], 200, {10, 6, 0}) ==
        "u/thigh: 6 of 10 are beyond the effort limit: Nm? 1 is 200 Nm");
  CHECK(AskActionUnit("u/thigh", hopper.joints[3], 200, {10, 5, 0}).empty());
}

// A pendulum that is pushed in every so many rows, with so many times its effort limit, and idles.
std::string Pushed(int every, double limits) {
  std::string csv = "t,q/pivot,v/pivot,u/pivot\n";
  for (int k = 0; k < 400; ++k) {
    csv += fmt::format("{},{},{},{}\n", 0.05 * k, std::sin(0.3 * k), 6 * std::cos(0.3 * k),
                       k % every == 0 ? 2 * limits : 0.1 * std::sin(k));
  }
  return csv;
}

TEST_CASE("a motor that idles, and is many times beyond its limit where it does not, is asked") {
  const auto warnings = ReadTable(Pushed(10, 300), LimitedPendulum()).warnings;
  REQUIRE(warnings.size() == 2);
  CHECK(warnings[0] == "40 actions go beyond the effort limits: clipped, as the task does");
  CHECK(warnings[1] == "u/pivot: 40 of 400 are beyond 5 times the effort limit: mNm?");
  // One bad reading, and what is a little beyond, as actions are before they are clipped.
  CHECK(ReadTable(Pushed(400, 300), LimitedPendulum()).warnings.size() == 1);
  CHECK(ReadTable(Pushed(10, 4), LimitedPendulum()).warnings.size() == 1);
}

TEST_CASE("rows a thousand control periods apart are asked about milliseconds") {
  CHECK_THAT(Refusal(SwingingTable(1, 1, 1, 1e3)),
             Catch::EndsWith("the task's control period is 0.05 s: is t in milliseconds?"));
  CHECK_THAT(Refusal(SwingingTable(1, 1, 1, 1e6)), Catch::EndsWith(": is t in microseconds?"));
  CHECK_THAT(Refusal(SwingingTable(1, 1, 1, 7)), Catch::EndsWith("control period is 0.05 s"));
}

}  // namespace
}  // namespace plumb
