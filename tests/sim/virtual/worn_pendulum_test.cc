// robots/pendulum/worn_weak.toml: how weak its motor is.
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <optional>

#include "sim/model.h"
#include "sim/virtual/virtual_plant.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

using Eigen::VectorXd;

/// [s] from hanging still to upright, pushed with `effort` to where it moves by what is decided on
/// once per period and acts `delay` [s] later; none if it takes more than 20 s.
std::optional<double> SwingUp(const RobotDescription& robot, double effort, double delay) {
  constexpr double kStep = 1e-3;
  VirtualPlant plant(Model(robot).Describe(Eigen::Vector3d(11, 1.1, 1.1)));
  plant.SetState(VectorXd::Constant(1, std::numbers::pi), VectorXd::Zero(1));
  const auto period = std::lround(robot.task.period / kStep), late = std::lround(delay / kStep);
  VectorXd decided = VectorXd::Zero(1), acting = decided;
  for (int i = 0; i < 20'000; ++i) {
    if (i % period == 0) decided[0] = plant.motor_v()[0] >= 0 ? effort : -effort;
    if (i % period == late) acting = decided;
    REQUIRE(plant.Advance(acting, kStep));
    if (std::abs(plant.q()[0] - std::numbers::pi) >= std::numbers::pi) return kStep * i;
  }
  return {};
}

TEST_CASE("the worn pendulum's weak motor just swings it up within an episode") {
  RobotDescription worn = LoadPendulum("worn_weak.toml");
  const double episode = worn.task.period * worn.task.steps, limit = worn.joints[0].effort_limit;
  UnmodelledJoint& wear = worn.virtual_robot.joints.at(0);
  REQUIRE(limit == 0.8);
  REQUIRE(LoadPendulum("weak.toml").joints[0].effort_limit == limit);
  wear.backlash = wear.rotor = 0;  // a tenth of a second, and most of the computing
  CHECK(SwingUp(worn, limit, wear.delay) < episode);
  CHECK(SwingUp(worn, limit - 0.1, wear.delay) > episode);
  // It is the friction: without it less would do.
  CHECK(SwingUp(LoadPendulum("weak.toml"), limit - 0.1, 0) < episode);
}

}  // namespace
}  // namespace plumb
