#pragma once

#include <catch2/catch.hpp>
#include <memory>
#include <vector>

#include "sim/residual_inputs.h"
#include "tests/trainer/pendulum.h"
#include "trainer/session.h"

namespace plumb {

/// A pendulum whose training takes little: six updates, then two.
inline RobotDescription PendulumRobot() {
  RobotDescription robot{};
  robot.name = "test robot";
  const auto log = ParameterDescription::Coordinate::kLog;
  robot.parameters = {{"gravity", "m/s^2", log, 10, .3},
                      {"mass/pole", "kg", log, 1, .03},
                      {"length/pole", "m", log, 1, .03}};
  robot.joints.resize(1);
  robot.joints[0].child = 1, robot.joints[0].axis = {0, 1, 0};
  robot.joints[0].effort_limit = 2;
  robot.links.resize(2);
  robot.task.name = "pendulum";
  robot.task.steps = 200;
  robot.training = PendulumSettings();
  robot.training.batch = 800;
  robot.training.hidden = {12, 10};
  robot.training.updates = 6;
  robot.training.updates_again = 2;
  return robot;
}

/// The prior, as an iteration's.
inline ParameterDistribution Distribution(int iteration) {
  ParameterDistribution distribution = ParameterDistribution::Prior(PendulumRobot());
  distribution.iteration = iteration;
  return distribution;
}

/// Of a model that was asked, and explains the robot.
inline ParameterDistribution Explaining(int iteration) {
  ParameterDistribution distribution = Distribution(iteration);
  distribution.explained = true;
  return distribution;
}

/// Of a model that does not explain the robot.
inline ParameterDistribution Lacking(int iteration) {
  ResidualFunction function;
  const int inputs = ResidualInputCount(PendulumRobot());
  function.mean = function.low = function.high = Eigen::VectorXd::Zero(inputs);
  function.scale = Eigen::VectorXd::Ones(inputs);
  function.centres = Eigen::MatrixXd::Zero(1, inputs);
  function.noise = Eigen::MatrixXd::Zero(2, 2);
  function.weights = {Eigen::MatrixXd::Zero(2, function.features())};
  function.bound = Eigen::VectorXd::Ones(2);
  function.unknown = Eigen::VectorXd::Zero(2);
  ParameterDistribution distribution = Distribution(iteration);
  Residual residual;
  residual.coordinates = {distribution.mixture.components[0].mean};
  residual.free = function;
  distribution.residual = std::make_shared<const Residual>(residual);
  return distribution;
}

inline TrainingSession NewSession(uint64_t seed = 4, int iterations = 2) {
  return TrainingSession(PendulumRobot(), MakeGymPendulum, iterations, seed, 1);
}

/// CONTROLLER_STATUS at the end of a policy's roll-out: a trial of 100 steps that all pay the same,
/// and exploration.
inline controller_status_t Tried(int iteration, double rate) {
  controller_status_t status{};
  status.policy_iteration = iteration;
  status.phase = controller_status_t::COMPLETE;
  status.purpose = policy_t::CALIBRATE;
  status.num_episodes = status.episodes_wanted = 2;
  status.episode = status.first_state_sequence = status.last_state_sequence = {1, 2};
  status.returns = {100 * rate, -1000};
  status.steps = {100, 100};
  status.late_rate = {rate, -10};
  status.fell = {0, 0};
  return status;
}

inline void TrainToTheEnd(TrainingSession& session) {
  for (int update = 0; session.training(); ++update) {
    REQUIRE(update < 100);
    session.Advance();
  }
}

/// The whole run of a session: what the trials pay, and whether the model explains the robot.
/// @return the policies, by iteration.
inline std::vector<policy_t> RunAll(TrainingSession& session, const std::vector<double>& rates,
                                    ParameterDistribution (*of)(int)) {
  std::vector<policy_t> policies;
  for (int iteration = 0; iteration <= static_cast<int>(rates.size()); ++iteration) {
    REQUIRE(session.Begin(of(iteration)));
    TrainToTheEnd(session);
    policies.push_back(session.Policy(1));
    if (!session.finished())
      REQUIRE(session.AddTrial(Tried(iteration, rates[static_cast<size_t>(iteration)])));
  }
  return policies;
}

}  // namespace plumb
