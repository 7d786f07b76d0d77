#include "experiments/bus_robot.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "calibrator/results/calibration.h"
#include "common/decompositions.h"
#include "sim/parameters.h"
#include "sim/tasks/task.h"
#include "sim/virtual/mujoco_backend.h"
#include "sim/virtual/ode_backend.h"
#include "tests/calibrator/hop_on_bus.h"

namespace plumb {
namespace {

RobotDescription RobotNamed(const std::string& name) {
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
    const RobotEpisode trial = system.Run(policy, true, 1000, static_cast<uint32_t>(i));
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
  for (const Transition& t : rollout.transitions)
    sum += t.q.sum() + t.v.sum() + t.efforts.back().effort.sum();
  return sum;
}

TEST_CASE("an episode is a function of seed and number, to the bit") {
  const std::string name = GENERATE("pendulum", "hopper");
  const RobotDescription robot = RobotNamed(name);
  const Eigen::VectorXd hidden = HiddenParameters(robot, 1);
  const GaussianPolicy policy = Wanderer(robot, 0.5f);
  BusRobot one(robot, robot, hidden, 7), other(robot, robot, hidden, 7);
  other.Run(policy, true, 1000, 5);  // what was before does not matter
  const auto a = one.Run(policy, true, 40, 3), b = other.Run(policy, true, 40, 3);
  CHECK(a.rollout.transitions.size() >= 10);
  CHECK(a.rollout.transitions.size() <= 40);
  CHECK(a.seconds <= 40 * robot.task.period);
  CHECK(a.sum_of_rewards == b.sum_of_rewards);
  CHECK(Sum(a.rollout) == Sum(b.rollout));
  CHECK(Sum(one.Run(policy, true, 40, 4).rollout) != Sum(a.rollout));
  CHECK(Sum(one.Run(policy, false, 40, 3).rollout) != Sum(a.rollout));
}

/// Holds a hopper's leg bent, off its stops, as springs and dampers do: there the observer is as
/// good as it says.
GaussianPolicy Crouch(const RobotDescription& robot, float sd) {
  constexpr float kStiffness = 2, kDamping = 0.1f;  // action per rad, per rad/s
  GaussianPolicy policy = Wanderer(robot, sd);
  const int observations = policy.shape().observations;
  REQUIRE(observations == 11);
  Eigen::Map<Eigen::MatrixXf> weight(policy.parameters.data(), 3, observations);
  Eigen::Map<Eigen::VectorXf> bias(policy.parameters.data() + weight.size(), 3);
  for (int i = 0; i < 3; ++i) {
    weight(i, 2 + i) = -kStiffness;
    weight(i, 8 + i) = -kDamping;
  }
  bias = kStiffness * Eigen::Vector3f(-0.3f, -0.6f, 0.3f);
  return policy;
}

Findings Found(const RobotDescription& model, std::vector<Rollout> rollouts) {
  Log log;
  log.name = "trials";
  log.rollouts = std::move(rollouts);
  return Calibrate(model, std::vector<Log>{log}, {});
}

TEST_CASE("what a robot without a gap does behind its bus calibrates to its hidden parameters") {
  const std::string name = GENERATE("pendulum", "hopper");
  CAPTURE(name);
  const RobotDescription robot = RobotNamed(name);
  const Eigen::VectorXd hidden = HiddenParameters(robot, 2);
  BusRobot system(robot, robot, hidden, 1);
  const bool hopper = name == "hopper";
  const GaussianPolicy policy = hopper ? Crouch(robot, 0.2f) : Wanderer(robot, 0.5f);
  const Gaussian posterior =
      Moments(Found(robot, Trials(system, policy, hopper ? 20 : 2)).posterior);
  const Eigen::VectorXd error = posterior.mean - hidden.array().log().matrix();
  const Eigen::VectorXd sd = posterior.covariance.diagonal().cwiseSqrt();
  INFO("errors " << error.transpose() << ", claimed " << sd.transpose());
  CHECK((error.array().abs() < 3 * sd.array()).all());
  // In units of what the posterior claims, whatever the parameters' correlations.
  CHECK(error.dot(posterior.covariance.llt().solve(error)) < 3 * static_cast<double>(error.size()));
  CHECK(sd.minCoeff() < 0.05);
  CHECK(sd.maxCoeff() < 0.12);  // the priors' are 0.17 to 0.3
}

TEST_CASE("friction and delay that no model knows are found where the model may have them") {
  RobotDescription truth = RobotNamed("pendulum/worn.toml");
  truth.virtual_robot.joints[0].backlash = 0;
  const RobotDescription model = RobotNamed("pendulum/worn_fitted.toml");
  BusRobot system(truth, model, HiddenParameters(truth, 2), 1);
  const std::vector<Rollout> rollouts = Trials(system, Wanderer(model, 0.5f), 3);
  const Findings blind = Found(RobotNamed("pendulum"), rollouts), found = Found(model, rollouts);
  CHECK(blind.misspecification.alarm);
  CHECK_FALSE(found.misspecification.alarm);
  const Gaussian posterior = Moments(found.posterior);
  const auto physical = [&](const char* name) {
    return model.ToPhysical(posterior.mean)[model.FindParameter(name)];
  };
  CHECK(physical("friction/pivot") == Approx(0.1).epsilon(0.15));
  // The observer expects a torque's step when it was commanded, and draws it towards there.
  CHECK(physical("delay/pivot") > 0.001);
  CHECK(physical("delay/pivot") < 0.005);
}

TEST_CASE("backlash is a gap that the pendulum's parameters do not close") {
  const RobotDescription truth = RobotNamed("pendulum/worn.toml"),
                         model = RobotNamed("pendulum/worn_fitted.toml");
  BusRobot system(truth, model, HiddenParameters(truth, 2), 1);
  CHECK(Found(model, Trials(system, Wanderer(model, 0.5f), 1)).misspecification.alarm);
}

TEST_CASE("a hopper that another program moves is driven through its bus as any other") {
  struct Other {
    std::string name;
    bool here;
  };
  const auto other = GENERATE(Other{"mujoco", HasMujoco()}, Other{"ode", HasOde()});
  const RobotDescription truth = RobotNamed("hopper/" + other.name + ".toml"),
                         model = RobotNamed("hopper");
  const Eigen::VectorXd hidden = HiddenParameters(truth, 2);
  BusRobot other_world(truth, model, hidden, 1), own_world(model, model, hidden, 1);
  if (!other.here) {
    CHECK_THROWS_WITH(other_world.Run(Wanderer(model, 0.5f), true, 100, 0),
                      Catch::Contains(other.name + ".toml:6:10: ") &&
                          Catch::Contains("lib" + other.name + "-dev"));
    return;
  }
  const std::vector<Rollout> there = Trials(other_world, Wanderer(model, 0.5f), 5),
                             here = Trials(own_world, Wanderer(model, 0.5f), 5);
  for (const Rollout& rollout : there) CHECK(rollout.transitions.size() >= 5);
  CHECK(Sum(there[0]) == Sum(Trials(other_world, Wanderer(model, 0.5f), 1)[0]));
  CHECK(Sum(there[0]) != Sum(here[0]));
  CHECK(HopOnBus(truth, 1).size() > 900);  // two seconds, and the driver does not stop
}

}  // namespace
}  // namespace plumb
