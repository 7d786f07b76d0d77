#include "trainer/robot_simulation.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>

#include "robot/parameter_distribution.h"
#include "tests/sim/residuals.h"
#include "trainer/rollout.h"

namespace plumb {
namespace {

RobotDescription Robot(const std::string& name, double position_noise, double velocity_noise) {
  RobotDescription robot =
      LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/" + name);
  robot.training.position_noise = position_noise;
  robot.training.velocity_noise = velocity_noise;
  return robot;
}

Eigen::VectorXd Nominal(const RobotDescription& robot) {
  ParameterDistribution prior = ParameterDistribution::Prior(robot);
  return prior.ToPhysical(prior.mixture.components[0].mean);
}

// A policy's observations over an episode of no action, a column for each step.
Eigen::MatrixXf Observations(const RobotDescription& robot, uint64_t seed, int steps) {
  const auto simulation = SimulateRobot(robot)();
  Random random(seed);
  simulation->Reset(Nominal(robot), random);
  Eigen::MatrixXf observations(simulation->observation_size(), steps);
  for (int i = 0; i < steps; ++i) {
    simulation->Observe(observations.col(i));
    simulation->Step(Eigen::VectorXf::Zero(simulation->action_size()));
  }
  return observations;
}

TEST_CASE(
    "what the policy is told scatters about what is as robot.toml says, and only for the policy") {
  const Eigen::MatrixXf clean = Observations(Robot("hopper", 0, 0), 3, 100);
  const Eigen::MatrixXf noisy = Observations(Robot("hopper", 0.01, 0.3), 3, 100);
  CHECK(Observations(Robot("hopper", 0.01, 0.3), 3, 100) == noisy);
  const Eigen::MatrixXf off = noisy - clean;
  // Five positions above six velocities; the motion itself is the same.
  const auto sd = [](const Eigen::MatrixXf& m) {
    return std::sqrt(m.cast<double>().squaredNorm() / static_cast<double>(m.size()));
  };
  CHECK(sd(off.topRows(5)) == Approx(0.01).epsilon(0.15));
  CHECK(sd(off.bottomRows(6)) == Approx(0.3).epsilon(0.15));
  CHECK(std::abs(off.topRows(5).mean()) < 0.002);
}

TEST_CASE("an observation is the same however often it is asked for") {
  const RobotDescription robot = Robot("hopper", 0.01, 0.3);
  const auto simulation = SimulateRobot(robot)();
  Random random(1);
  simulation->Reset(Nominal(robot), random);
  Eigen::VectorXf first(11), second(11);
  simulation->Observe(first), simulation->Observe(second);
  CHECK(first == second);
}

TEST_CASE("each episode has noise and an initial state of its own") {
  const RobotDescription robot = Robot("pendulum", 0.01, 0);
  CHECK(Observations(robot, 1, 3) != Observations(robot, 2, 3));
}

TEST_CASE("a simulator that cannot be is refused") {
  const RobotDescription robot = Robot("pendulum", 0, 0);
  const auto simulation = SimulateRobot(robot)();
  Random random(1);
  Eigen::VectorXd impossible = Nominal(robot);
  impossible(1) = -1;
  CHECK_THROWS_AS(simulation->Reset(impossible, random), std::invalid_argument);
}

TEST_CASE("episodes that a residual blows up are dropped and counted, whatever they would pay") {
  const RobotDescription robot = Robot("hopper", 0, 0);
  const auto residual = Of(robot);
  residual->free = residual->touching = Constant(robot, Eigen::VectorXd::Constant(6, 1e7));
  residual->free->bound.setConstant(1e7), residual->touching->bound.setConstant(1e7);
  const ParameterSampler sample = [&](Random& random) {
    SimulatorDraw draw(Nominal(robot));
    if (random.Uniform(0, 1) < 0.3) draw.residual = residual;
    return draw;
  };
  Workers workers(1);
  const PolicyShape shape{11, {8}, 3};
  RolloutSampler rollout(SimulateRobot(robot), shape, workers);
  GaussianPolicy policy(shape);
  const Batch batch = rollout.Collect(policy, sample, 500, 1, 7, 1, 2);
  CHECK(batch.dropped > 0);
  CHECK(batch.dropped < batch.played);
  for (const double reward : batch.rewards) CHECK(std::abs(reward) < 100);
}

}  // namespace
}  // namespace plumb
