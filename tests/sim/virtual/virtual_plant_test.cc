#include "sim/virtual/virtual_plant.h"

#include <catch2/catch.hpp>
#include <limits>

#include "sim/model.h"
#include "sim/simulator.h"
#include "sim/virtual/simbody_plant.h"
#include "tests/sim/trees.h"
#include "tests/sim/virtual/ball.h"

namespace plumb {

using Eigen::VectorXd;

TEST_CASE("a mechanism is Simbody's where that knows all the robot has") {
  const RobotDescription robot = Known("pendulum");
  VirtualPlant mechanism(robot);
  SimbodyPlant plant(robot);
  const VectorXd one = VectorXd::Ones(1);
  mechanism.SetState(one, one);
  plant.SetState(one, one);
  REQUIRE(mechanism.Advance(one, 0.1));
  REQUIRE(plant.Advance(one, 0.1));
  CHECK(mechanism.q() == plant.q());
  CHECK(mechanism.v() == plant.v());
}

TEST_CASE("a mechanism with armature moves as the simulator does, but for its integration errors") {
  RobotDescription robot = Known("double_pendulum");
  REQUIRE_FALSE(SimbodyPlant::Lacks(robot).empty());
  VirtualPlant mechanism(robot);
  const VectorXd q = Eigen::Vector2d(0.4, -1), v = Eigen::Vector2d(2, -1),
                 effort = Eigen::Vector2d(0.3, -0.2);
  mechanism.SetState(q, v);
  for (int i = 0; i < 50; ++i) REQUIRE(mechanism.Advance(effort, 0.0041));
  const auto error = [&](double substep) {
    robot.simulation.substep = substep;
    Simulator simulator(robot);
    simulator.SetState(q, v);
    simulator.Step(effort, 50 * 0.0041);
    return (simulator.q() - mechanism.q()).norm();
  };
  robot.simulation.integrator = SimulationSettings::Integrator::kSemiImplicit;
  CHECK(error(1e-4) < 1e-3);
  // towards the mechanism, at first order
  CHECK(error(1e-5) / error(1e-4) == Approx(0.1).epsilon(0.2));
}

TEST_CASE("a mechanism stays where it is rather than leave the finite") {
  for (const char* name : {"pendulum", "double_pendulum"}) {
    VirtualPlant mechanism(Known(name));
    const VectorXd state = VectorXd::Constant(mechanism.q().size(), 0.5);
    mechanism.SetState(state, state);
    CHECK_FALSE(mechanism.Advance(
        VectorXd::Constant(state.size(), std::numeric_limits<double>::quiet_NaN()), 0.01));
    CHECK_FALSE(mechanism.Advance(VectorXd::Constant(state.size(), 1e308), 10));
    CHECK(mechanism.q().allFinite());
    CHECK(mechanism.Advance(0 * state, 0.01));
    CHECK_THROWS_AS(mechanism.SetState(state * std::numeric_limits<double>::infinity(), state),
                    std::invalid_argument);
  }
}

TEST_CASE("a mechanism's encoders are right") {
  RobotDescription robot = Known("double_pendulum");
  robot.joints[1].dynamics.sensor_bias = 0.1;
  CHECK_THROWS_AS(VirtualPlant(robot), std::invalid_argument);
}

}  // namespace plumb
