#include "experiments/bus_simulation.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <string>

#include "experiments/bus_robot.h"
#include "sim/parameters.h"
#include "sim/tasks/task.h"

namespace plumb {
namespace {

RobotDescription RobotToml(const std::string& name) {
  return LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/" + name +
                   "/robot.toml");
}

GaussianPolicy SomePolicy(const RobotDescription& robot) {
  const auto task = MakeTask(robot);
  GaussianPolicy policy({task->observation_size(), {8}, task->action_size()});
  policy.action_scale = robot.effort_limits().cast<float>();
  Random random(4);
  for (float& parameter : policy.parameters) parameter = 0.3f * static_cast<float>(random.Normal());
  return policy;
}

}  // namespace

TEST_CASE("a policy returns as much in the robot's simulation as on the robot") {
  const std::string name = GENERATE("pendulum", "hopper");
  RobotDescription robot = RobotToml(name);
  robot.task.steps = 60;
  const Eigen::VectorXd hidden = HiddenParameters(robot, 1);
  const GaussianPolicy policy = SomePolicy(robot);
  const auto simulation = SimulateBusRobot(robot, robot, hidden, 7)();
  Random random(3), same(3);
  simulation->Reset(SimulatorDraw(Eigen::VectorXd()), random);
  Eigen::VectorXf observation(simulation->observation_size());
  StepResult result{};
  double sum = 0;
  int steps = 0;
  while (!result.terminated && steps < simulation->steps_per_episode()) {
    simulation->Observe(observation);
    result = simulation->Step(policy.Mean(observation));
    sum += result.reward, ++steps;
  }
  BusRobot real(robot, robot, hidden, 7);
  const RobotEpisode episode = real.Run(policy, false, 60, same.Bits() % (1u << 20));
  CHECK(sum == Approx(episode.sum_of_rewards).epsilon(1e-12));
  CHECK(steps == episode.trial.steps);
  CHECK(result.terminated == episode.trial.fell);
  simulation->Observe(observation);  // of the state that it has ended with
  CHECK(observation.allFinite());
}

TEST_CASE("an episode on the robot may be left at any time") {
  const RobotDescription robot = RobotToml("pendulum");
  const auto simulation = SimulateBusRobot(robot, robot, HiddenParameters(robot, 1), 7)();
  Random random(3);
  for (int steps : {0, 3, 0}) {
    simulation->Reset(SimulatorDraw(Eigen::VectorXd()), random);
    for (int i = 0; i < steps; ++i)
      CHECK(std::isfinite(simulation->Step(Eigen::VectorXf::Zero(1)).reward));
  }
}

}  // namespace plumb
