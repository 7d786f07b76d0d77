#include "experiments/bus_robot.h"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <string>
#include <vector>

#include "calibrator/calibration.h"
#include "sim/parameters.h"
#include "sim/tasks/task.h"

namespace plumb {
namespace {

RobotDescription Robot(const std::string& name) {
  return LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/" + name);
}

/// Wanders: its mean is zero.
GaussianPolicy Wanderer(const RobotDescription& robot, float sd) {
  const auto task = MakeTask(robot);
  GaussianPolicy policy({task->observation_size(), {}, task->action_size()});
  policy.action_scale = robot.effort_limits().cast<float>();
  policy.parameters.tail(task->action_size()).setConstant(std::log(sd));
  return policy;
}

std::vector<Rollout> Trials(BusRobot& system, const GaussianPolicy& policy, int count) {
  std::vector<Rollout> rollouts;
  for (int i = 0; i < count; ++i) {
    const RealSystem::Trial trial = system.Run(policy, true, 1000, static_cast<uint32_t>(i));
    INFO(system.stopped());
    CHECK(system.stopped().empty());
    CHECK_FALSE(trial.rollout.transitions.empty());
    CHECK(std::isfinite(trial.sum_of_rewards));
    rollouts.push_back(trial.rollout);
  }
  return rollouts;
}

double Sum(const Rollout& rollout) {
  double sum = 0;
  for (const Transition& t : rollout.transitions) sum += t.q.sum() + t.v.sum() + t.efforts.back().effort.sum();
  return sum;
}

TEST_CASE("a trial is a function of seed and number, to the bit") {
  const std::string name = GENERATE("pendulum", "hopper");
  const RobotDescription robot = Robot(name);
  const Eigen::VectorXd hidden = HiddenParameters(robot, 1);
  const GaussianPolicy policy = Wanderer(robot, 0.5f);
  BusRobot one(robot, robot, hidden, 7), other(robot, robot, hidden, 7);
  other.Run(policy, true, 1000, 5);  // what was before does not matter
  const auto a = one.Run(policy, true, 40, 3), b = other.Run(policy, true, 40, 3);
  CHECK(a.rollout.transitions.size() >= 20);
  CHECK(a.rollout.transitions.size() <= 40);
  CHECK(a.seconds <= 40 * robot.task.period);
  CHECK(a.sum_of_rewards == b.sum_of_rewards);
  CHECK(Sum(a.rollout) == Sum(b.rollout));
  CHECK(Sum(one.Run(policy, true, 40, 4).rollout) != Sum(a.rollout));
  CHECK(Sum(one.Run(policy, false, 40, 3).rollout) != Sum(a.rollout));
}

TEST_CASE("what a robot without a gap does behind its bus calibrates to its hidden parameters") {
  const std::string name = "pendulum";
  CAPTURE(name);
  const RobotDescription robot = Robot(name);
  const Eigen::VectorXd hidden = HiddenParameters(robot, 2);
  BusRobot system(robot, robot, hidden, 1);
  Log log;
  log.name = "trials";
  log.rollouts = Trials(system, Wanderer(robot, 0.5f), name == "pendulum" ? 2 : 12);
  const Findings findings = Calibrate(robot, std::vector<Log>{log}, {});
  const Gaussian posterior = Moments(findings.posterior);
  const Eigen::VectorXd error = posterior.mean - hidden.array().log().matrix();
  // In units of what the posterior claims, whatever the parameters' correlations.
  const double distance = error.dot(posterior.covariance.llt().solve(error)) / static_cast<double>(error.size());
  const Eigen::VectorXd sd = posterior.covariance.diagonal().cwiseSqrt();
  INFO("errors " << error.transpose() << ", claimed " << sd.transpose() << ", mean square " << distance);
  CHECK(distance < 6);
  CHECK((error.array().abs() < 4 * sd.array()).all());
  CHECK(sd.minCoeff() < 0.05);
}

}  // namespace
}  // namespace plumb
