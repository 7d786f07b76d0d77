#include "sim/virtual/sprung_masses.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "sim/virtual/mujoco_backend.h"
#include "sim/virtual/simbody_backend.h"
#include "sim/virtual/virtual_plant.h"
#include "tests/sim/virtual/sprung_carrier.h"

namespace plumb {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;
using PlantEngine = VirtualRobotSettings::Engine;

constexpr double kMass = SprungCarrier::kMass, kCarrier = SprungCarrier::kCarrier,
                 kFrequency = SprungCarrier::kFrequency,
                 kDampingRatio = SprungCarrier::kDampingRatio;

RobotDescription Carrier(PlantEngine engine) { return SprungCarrier::Robot(engine); }

TEST_CASE("a sprung mass swings against the link that carries it") {
  constexpr double kForce = 10 * SprungCarrier::kBoth;
  for (const PlantEngine engine :
       {PlantEngine::kAuto, PlantEngine::kMujoco, PlantEngine::kSimbody}) {
    RobotDescription carrier = Carrier(engine);
    carrier.simulation.gravity = 0;
    VirtualPlant plant(carrier);
    plant.SetState(Vector2d(0, 3), Vector2d::Zero());
    CHECK(plant.q().size() == 2);
    for (int i = 1; i <= 60; ++i) {
      REQUIRE(plant.Advance(Vector2d(0, kForce), 0.005));
      REQUIRE(plant.q()[1] == Approx(3 + SprungCarrier::Rise(kForce, 0.005 * i)).margin(2e-5));
      REQUIRE(std::abs(plant.q()[0]) < 1e-9);
    }
  }
}

TEST_CASE("a sprung mass rests where it is said to be, and weighs") {
  for (const PlantEngine engine :
       {PlantEngine::kAuto, PlantEngine::kMujoco, PlantEngine::kSimbody}) {
    VirtualPlant plant(Carrier(engine));
    plant.SetState(Vector2d(0, 3), Vector2d::Zero());
    REQUIRE(plant.Advance(Vector2d(0, 9.81 * (kMass + kCarrier)), 0.5));
    CHECK(plant.q()[1] == Approx(3).margin(1e-6));
    CHECK(std::abs(plant.v()[1]) < 1e-6);
  }
}

TEST_CASE("a sprung mass ends at its stops") {
  // Its carrier is pushed as hard as if it could not move: its own joint is looked at.
  RobotDescription carrier = Carrier(PlantEngine::kAuto);
  carrier.virtual_robot.sprung_masses[0].travel = 0.02;
  const RobotDescription real = WithSprungMasses(carrier);
  REQUIRE(real.joints.size() == 3);
  REQUIRE(real.links[3].mass == kMass);
  const VectorXd effort = Vector3d(0, 500, 0);
  for (const auto& make : {&MakeMujocoBackend, &MakeSimbodyBackend}) {
    const auto engine = make(real);
    engine->SetState(Vector3d(0, 3, 0), VectorXd::Zero(3));
    double lowest = 0;
    for (int i = 0; i < 100; ++i) {
      REQUIRE(engine->Advance(effort, 0.001));
      lowest = std::min(lowest, engine->q()[2]);
    }
    CHECK(lowest < -0.02);
    CHECK(lowest > -0.05);  // without stops, 200 / own^2 = 0.2 at least
  }
}

TEST_CASE("a sprung mass may be on any link, in any order that an engine has") {
  // In MuJoCo joints are depth first: a mass on the first arm comes before the second arm there.
  RobotDescription tree = MakeTree();
  tree.virtual_robot.sprung_masses = {{.name = "load",
                                       .link = 2,
                                       .mass = 0.2,
                                       .frequency = 3,
                                       .damping_ratio = 0.2,
                                       .axis = Vector3d(1, 2, 2) / 3,
                                       .centre = {0.1, 0.1, 0.2},
                                       .travel = std::numeric_limits<double>::infinity()}};
  const VectorXd q = Eigen::Vector4d(0.1, -0.5, 0.7, 1.2), v = Eigen::Vector4d(0.3, 1, -1, 2),
                 effort = Eigen::Vector4d(5, 1, -0.5, 0.3);
  std::vector<VectorXd> ends;
  for (const PlantEngine engine :
       {PlantEngine::kAuto, PlantEngine::kMujoco, PlantEngine::kSimbody}) {
    tree.virtual_robot.engine = engine;
    VirtualPlant plant(tree);
    plant.SetState(q, v);
    for (int i = 0; i < 100; ++i) REQUIRE(plant.Advance(effort, 0.005));
    ends.push_back(plant.q());
  }
  CHECK((ends[0] - q).norm() > 0.5);
  CHECK((ends[1] - ends[0]).norm() < 1e-5);
  CHECK((ends[2] - ends[0]).norm() < 1e-4);
}

}  // namespace
}  // namespace plumb
