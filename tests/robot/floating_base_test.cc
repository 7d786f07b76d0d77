// Which robots may do without a boom, and what the others are told.

#include "robot/floating_base.h"

#include <catch2/catch.hpp>
#include <fstream>

#include "tests/replaced.h"
#include "tests/robot/zoo.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

using Catch::Contains;

std::string HopperFile(const std::string& file) {
  std::ifstream in(SourceFile("robots/hopper/" + file));
  return {std::istreambuf_iterator<char>(in), {}};
}

RobotDescription LoadHopper(const std::string& toml,
                            const std::string& urdf = HopperFile("robot.urdf")) {
  return LoadRobot(RobotFolder(urdf, toml).path());
}

TEST_CASE("floating base: the hopper's torso without its boom") {
  const RobotDescription robot = LoadHopper(HopperFile("free.toml"));
  CHECK(robot.estimator.base == EstimatorSettings::Base::kLegs);
  CHECK(robot.estimator.ground_sd == 0.018);
  CHECK(robot.estimator.slip == 0.05);
  const FloatingBase base = FloatingBaseOf(robot);
  CHECK(robot.links[static_cast<size_t>(base.link)].name == "torso");
  REQUIRE(base.slides.size() == 2);
  CHECK(base.slides[0].direction == Eigen::Vector3d::UnitX());
  CHECK(base.slides[1].direction == Eigen::Vector3d::UnitZ());
  CHECK(base.normal() == Eigen::Vector3d::UnitY());
  for (int i = 0; i < 6; ++i) CHECK(base.Has(i) == (i < 3));

  const RobotDescription on_boom = LoadRobot(SourceFile("robots/hopper"));
  CHECK(on_boom.estimator.base == EstimatorSettings::Base::kSensors);
  CHECK_THROWS_WITH(FloatingBaseOf(on_boom), Contains("rootx") && Contains("boom_yaw"));
}

TEST_CASE("floating base: who cannot do without a boom is told why, and where") {
  const std::string toml = HopperFile("free.toml"), urdf = HopperFile("robot.urdf");
  const auto refused = [&](const std::string& other_toml, const std::string& other_urdf,
                           const std::string& what) {
    INFO(what);
    CHECK_THROWS_WITH(LoadHopper(other_toml, other_urdf),
                      Contains("robot.toml:") && Contains(what));
  };
  const auto without = [](const std::string& text, const std::string& from, const std::string& to) {
    const size_t at = text.find(from), end = text.find(to, at);
    REQUIRE(end != std::string::npos);
    return text.substr(0, at) + text.substr(end);
  };
  refused(without(toml, "[[sensor]]", "[estimator]"), urdf, "no IMU");
  refused(Replaced(toml, "link = \"torso\"", "link = \"thigh\""), urdf, "beyond");
  refused(Replaced(toml, "link = \"torso\"", "link = \"root_z\""), urdf, "upright plane");
  refused(without(toml, "[simulation.contact]", "[simulation.limit]"), urdf, "touch the ground");
  refused(toml, without(urdf, "<collision>", "</link>\n  <joint name=\"rootx\""),
          "touch the ground");
  refused(toml, Replaced(urdf, "<axis xyz=\"0 1 0\"/>", "<axis xyz=\"1 0 0\"/>"), "upright plane");
  refused(toml, Replaced(urdf, "<axis xyz=\"1 0 0\"/>", "<axis xyz=\"0.6 0 0.8\"/>"),
          "right angles");
  refused(Replaced(toml, "base = \"legs\"", "base = \"feet\""), urdf, "base");
  refused(Replaced(toml, "ground_sd = 0.018", "ground_sd = 0"), urdf, "ground_sd");
  refused(Replaced(toml, "base = \"legs\"", "base = \"sensors\""), urdf, "ground_sd");

  RobotDescription robot = LoadHopper(toml);
  robot.joints[2].type = JointDescription::Type::kSpherical;
  CHECK_THROWS_WITH(FloatingBaseOf(robot), Contains("along three"));
  robot = LoadHopper(toml);
  robot.joints[1].passive = false;
  CHECK_THROWS_WITH(FloatingBaseOf(robot), Contains("motor of \"rootz\""));
  robot = LoadHopper(toml);
  Shape sphere;
  robot.links[1].collisions.push_back(sphere);
  CHECK_THROWS_WITH(FloatingBaseOf(robot), Contains("does not hang"));
  robot = LoadHopper(toml);
  for (int i = 0; i < 40; ++i) robot.links.back().collisions.push_back(sphere);
  CHECK_THROWS_WITH(FloatingBaseOf(robot), Contains("more than 32"));
}

}  // namespace
}  // namespace plumb
