// Numbers that nobody means: the simulator's answer to them is defined, and the next episode does
// not know of them.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "common/special_numbers.h"
#include "sim/simulator.h"
#include "tests/sim/allocations.h"
#include "tests/sim/trees.h"

namespace plumb {
namespace {

using Eigen::VectorXd;

// On the ground, with everything that can act; and once through space.
std::vector<RobotDescription> Robots() {
  RobotDescription hopper = LoadExample("hopper");
  for (size_t i = 3; i < 6; ++i) {
    hopper.joints[i].dynamics.delay = 0.003;
    hopper.joints[i].dynamics.friction = 0.1;
    hopper.joints[i].dynamics.sensor_delay = 0.001;
  }
  RobotDescription spatial = FromUrdf(TreeWriter(11).Spatial(8));
  const bool turns =
      std::any_of(spatial.joints.begin(), spatial.joints.end(), [](const JointDescription& joint) {
        return joint.type == JointDescription::Type::kSpherical;
      });
  REQUIRE(turns);
  spatial.simulation.contact = hopper.simulation.contact;
  spatial.simulation.stop = hopper.simulation.stop;
  Shape ball;
  ball.size = {0.2, 0, 0};
  for (size_t i = 1; i < spatial.links.size(); ++i) spatial.links[i].collisions.push_back(ball);
  spatial.parameters = {{.name = "gravity",
                         .unit = "",
                         .coordinate = ParameterDescription::Coordinate::kLog,
                         .mean = 9.81,
                         .variance = 1}};
  return {hopper, spatial};
}

VectorXd RestPosition(const RobotDescription& robot) {
  VectorXd q = VectorXd::Zero(robot.num_positions());
  Eigen::Index at = 0;
  for (const JointDescription& joint : robot.joints) {
    if (joint.type == JointDescription::Type::kSpherical) q[at] = 1;
    at += joint.num_positions();
  }
  return q;
}

// The end of an ordinary episode.
VectorXd Episode(Simulator& simulator) {
  const RobotDescription& robot = simulator.model().description();
  simulator.SetParameters(simulator.model().parameters().means());
  simulator.SetState(RestPosition(robot), VectorXd::Zero(robot.num_velocities()));
  Random random(1);
  for (int i = 0; i < 20; ++i)
    simulator.Step(DrawNumbers(robot.num_velocities(), random, 5), 0.008);
  VectorXd end(robot.num_positions() + robot.num_velocities());
  end << simulator.q(), simulator.v();
  return end;
}

}  // namespace

TEST_CASE("hostile: states and efforts beyond sense leave no trace") {
  for (const RobotDescription& robot : Robots()) {
    INFO(robot.name);
    Simulator simulator(robot), fresh(robot);
    const VectorXd expected = Episode(fresh);
    REQUIRE(expected.allFinite());
    const int n = robot.num_velocities();
    const VectorXd rest = RestPosition(robot), still = VectorXd::Zero(n);
    for (const double bad : {kNaN, kInfinity, -kInfinity}) {
      for (int i = 0; i < robot.num_positions(); ++i) {
        VectorXd q = rest;
        q[i] = bad;
        CHECK_THROWS_AS(simulator.SetState(q, still), std::invalid_argument);
        CHECK_THROWS_AS(simulator.SetReading(q, still, still), std::invalid_argument);
      }
      for (int i = 0; i < n; ++i) {
        VectorXd v = still;
        v[i] = bad;
        CHECK_THROWS_AS(simulator.SetState(rest, v), std::invalid_argument);
        simulator.SetState(rest, still);
        simulator.Step(v, 0.008);
        simulator.Step(still, 0.008);  // a delayed effort has arrived by now
        CHECK_FALSE(simulator.finite());
        const VectorXd stays = simulator.q();
        simulator.Step(still, 0.008);
        CHECK_FALSE(simulator.finite());
        CHECK((stays.array().isNaN() == simulator.q().array().isNaN()).all());
        REQUIRE(Episode(simulator) == expected);
      }
    }
    Random random(2);
    for (const double huge : {1e5, 1e8, 1e20, 1e100, 1e160, 1e308, 1e-308, 5e-324}) {
      for (int i = 0; i < 20; ++i) {
        VectorXd q = DrawNumbers(robot.num_positions(), random, 1), v = DrawNumbers(n, random, 1);
        for (double& entry : q) entry *= random.Uniform() < 0.5 ? huge : 1;
        for (double& entry : v) entry *= random.Uniform() < 0.5 ? huge : 1;
        VectorXd effort = DrawNumbers(n, random, 1);
        effort[i % n] *= huge;
        REQUIRE_NOTHROW(simulator.SetState(q, v));
        for (int k = 0; k < 5; ++k) REQUIRE_NOTHROW(simulator.Step(effort, 0.008));
        CHECK(simulator.finite() == (simulator.q().allFinite() && simulator.v().allFinite()));
        REQUIRE_NOTHROW(simulator.Reading());
        REQUIRE_NOTHROW(simulator.MassMatrix());
        REQUIRE_NOTHROW(simulator.Bias());
        REQUIRE(Episode(simulator) == expected);
      }
    }
  }
}

TEST_CASE("hostile: durations") {
  for (const RobotDescription& robot : Robots()) {
    Simulator simulator(robot);
    const VectorXd expected = Episode(simulator);
    const VectorXd still = VectorXd::Zero(robot.num_velocities());
    const VectorXd before = simulator.q();
    for (const double none : {0.0, -0.0, -1.0, -kInfinity, kNaN}) {
      simulator.Step(still, none);
      simulator.Step(std::vector<EffortSegment>{{none, still}, {none, still}});
      CHECK(simulator.q() == before);
    }
    // There is no end to it: refused.
    CHECK_THROWS_AS(simulator.Step(still, kInfinity), std::invalid_argument);
    CHECK_THROWS_AS(simulator.Step(std::vector<EffortSegment>{{0.001, still}, {kInfinity, still}}),
                    std::invalid_argument);
    CHECK(simulator.q() == before);
    for (const double tiny : {5e-324, 1e-300, 1e-20}) {
      simulator.Step(still, tiny);
      CHECK(simulator.finite());
      CHECK((simulator.q() - before).norm() < 1e-12);
      simulator.Step(
          std::vector<EffortSegment>{{tiny, still}, {2 * tiny, VectorXd::Ones(still.size())}});
      CHECK(simulator.finite());
    }
    REQUIRE(Episode(simulator) == expected);
  }
}

TEST_CASE("hostile: parameters") {
  for (const RobotDescription& robot : Robots()) {
    Simulator simulator(robot);
    const VectorXd expected = Episode(simulator);
    const VectorXd means = simulator.model().parameters().means(),
                   still = VectorXd::Zero(robot.num_velocities());
    for (Eigen::Index i = 0; i < means.size(); ++i) {
      for (const double bad : {kNaN, kInfinity, -kInfinity, -1.0}) {
        VectorXd physical = means;
        physical[i] = bad;
        CHECK_THROWS_AS(simulator.SetParameters(physical), std::invalid_argument);
      }
      for (const double odd : {1e300, 1e-300, 5e-324}) {
        VectorXd physical = means;
        physical[i] = odd;
        REQUIRE_NOTHROW(simulator.SetParameters(physical));
        simulator.SetState(RestPosition(robot), still);
        for (int k = 0; k < 10; ++k) REQUIRE_NOTHROW(simulator.Step(still, 0.008));
        REQUIRE(Episode(simulator) == expected);
      }
    }
  }
}

TEST_CASE("hostile: nothing allocates while the robot moves") {
  for (RobotDescription robot : Robots()) {
    robot.simulation.substep = 0.002;
    Simulator simulator(robot);
    const int n = robot.num_velocities();
    const VectorXd rest = RestPosition(robot), still = VectorXd::Zero(n),
                   means = simulator.model().parameters().means();
    std::vector<EffortSegment> profile;
    for (int i = 0; i < 5; ++i) profile.push_back({0.0017, VectorXd::Constant(n, i % 3 - 1.0)});
    VectorXd effort = VectorXd::Ones(n);
    Episode(simulator);
    simulator.Step(profile);
    const int64_t before = Allocations();
    for (int i = 0; i < 500; ++i) {
      if (i % 50 == 0) {
        simulator.SetReading(rest, still, effort);
        simulator.Recall(profile);
      }
      effort *= -1;
      simulator.Step(effort, 0.008);
      simulator.Step(profile);
      simulator.SetParameters(means);
      simulator.Reading();
    }
    CHECK(Allocations() == before);
    CHECK(simulator.finite());
  }
}

}  // namespace plumb
