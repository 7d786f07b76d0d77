// A ground that no model knows, as every engine has it.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "sim/virtual/virtual_plant.h"
#include "tests/sim/virtual/ball.h"

namespace plumb {
namespace {

using Eigen::Vector2d;
using PlantEngine = VirtualRobotSettings::Engine;

UnmodelledGround Stiffer(double factor) {
  UnmodelledGround ground;
  ground.stiffness_factor = factor;
  return ground;
}
UnmodelledGround Slippery(double friction) {
  UnmodelledGround ground;
  ground.friction = friction;
  return ground;
}
RobotDescription On(PlantEngine engine, const UnmodelledGround& ground) {
  RobotDescription ball = Ball();
  ball.virtual_robot.engine = engine;
  ball.virtual_robot.ground = ground;
  return ball;
}

/// Where it is after a time without efforts.
Vector2d PositionAfter(const RobotDescription& robot, const Vector2d& q, double duration,
                       const Vector2d& v = Vector2d::Zero()) {
  VirtualPlant plant(robot);
  plant.SetState(q, v);
  for (double t = 0; t < duration; t += 0.0037)
    REQUIRE(plant.Advance(Vector2d::Zero(), std::min(0.0037, duration - t)));
  return plant.q();
}

/// How deep a ball lies, which gravity alone makes.
double Depth(PlantEngine engine, double stiffness_factor) {
  return 0.1 - PositionAfter(On(engine, Stiffer(stiffness_factor)), {0, 0.1}, 3)[1];
}

TEST_CASE("a ground that is stiffer gives way less") {
  // The simulator's: weight / stiffness.
  CHECK(Depth(PlantEngine::kAuto, 1) == Approx(2 * 9.81 / 15000).epsilon(1e-3));
  CHECK(Depth(PlantEngine::kAuto, 5) == Approx(2 * 9.81 / 75000).epsilon(1e-3));
  // MuJoCo's: from the margin of a millimetre on, and inversely to the square of solref's time.
  const double soft = Depth(PlantEngine::kMujoco, 1) + 1e-3,
               stiff = Depth(PlantEngine::kMujoco, 5) + 1e-3;
  CHECK(soft > 5e-5);
  CHECK(soft / stiff == Approx(5).epsilon(1e-3));
  // Simbody's is tested with its formula.
  CHECK(Depth(PlantEngine::kSimbody, 5) < Depth(PlantEngine::kSimbody, 1) - 2e-4);
}

TEST_CASE("a slippery ground holds less, whatever the robot's contact says") {
  for (const PlantEngine engine :
       {PlantEngine::kAuto, PlantEngine::kMujoco, PlantEngine::kSimbody}) {
    const auto slid = [&](double friction) {
      return PositionAfter(On(engine, Slippery(friction)), {0, 0.0997}, 1, {2, 0})[0];
    };
    // v^2 / 2 mu g, and what creeps and bounces.
    const double share = engine == PlantEngine::kSimbody ? 0.8 : 1;
    CHECK(slid(0.7) == Approx(4 / (2 * 0.7 * share * 9.81)).epsilon(0.15));
    CHECK(slid(1.4) == Approx(4 / (2 * 1.4 * share * 9.81)).epsilon(0.2));
  }
}

TEST_CASE("on a slope gravity leans") {
  for (const PlantEngine engine : {PlantEngine::kMujoco, PlantEngine::kSimbody}) {
    const double slope = 0.6;
    const Vector2d fallen = PositionAfter(On(engine, Slope(slope)), {0, 10}, 0.5);
    CHECK(fallen[0] == Approx(-0.125 * 9.81 * std::sin(slope)).epsilon(1e-9));
    CHECK(fallen[1] == Approx(10 - 0.125 * 9.81 * std::cos(slope)).epsilon(1e-9));
    // A friction of 0.5 holds up to 0.46 rad; beyond, it slides down.
    CHECK(std::abs(PositionAfter(On(engine, Slope(0.3)), {0, 0.1}, 1)[0]) < 0.1);
    const double share = engine == PlantEngine::kSimbody ? 0.8 : 1;
    CHECK(PositionAfter(On(engine, Slope(slope)), {0, 0.0997}, 1)[0] ==
          Approx(-0.5 * 9.81 * (std::sin(slope) - 0.5 * share * std::cos(slope))).epsilon(0.1));
  }
}

}  // namespace
}  // namespace plumb
