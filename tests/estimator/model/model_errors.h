#pragma once

#include <vector>

#include "estimator/model/unscented_observer.h"
#include "tests/estimator/observer_errors.h"

namespace plumb {

/// Errors of causal states, one each per joint.
struct ModelErrors {
  std::vector<StateErrors> kinematic, model;
  int64_t restarts = 0;  ///< of the filter on the model
};

/// The robot with the parameters that SimulatedReadings has, but for the masses of all links: those
/// times `mass`.
inline RobotDescription Assumed(const RobotDescription& robot, double mass = 1) {
  Eigen::VectorXd parameters(static_cast<Eigen::Index>(robot.parameters.size()));
  for (size_t i = 0; i < robot.parameters.size(); ++i) {
    const ParameterDescription& p = robot.parameters[i];
    const bool heavier = p.name.rfind("mass/", 0) == 0;
    parameters[static_cast<Eigen::Index>(i)] =
        p.ToPhysical(p.coordinate_mean()) * (heavier ? mass : 1);
  }
  return Model(robot).Describe(parameters);
}

/// @param assumed what the filter on the model takes for the robot.
inline ModelErrors Compare(const RobotDescription& robot, const RobotDescription& assumed,
                           const Recordings& recordings) {
  constexpr size_t kSettle = 50;  // samples
  const auto n = static_cast<size_t>(robot.num_joints());
  ModelErrors errors{std::vector<StateErrors>(n), std::vector<StateErrors>(n)};
  for (const auto& recording : recordings) {
    StateObserver kinematic(robot);
    UnscentedObserver model(assumed);
    for (size_t k = 0; k < recording.size(); ++k) {
      const SimulatedReadings::Sample& sample = recording[k];
      for (const imu_t& imu : sample.imus) kinematic.OnImu(imu);
      if (!kinematic.OnJointState(sample.joints)) continue;
      model.OnJointState(sample.joints, kinematic.state());
      if (k < kSettle) continue;
      for (size_t i = 0; i < n; ++i) {
        const auto at = static_cast<Eigen::Index>(i);
        const auto add = [&](const robot_state_t& state, StateErrors& into) {
          into.Add(state.q[i] - sample.q[at], state.v[i] - sample.v[at], state.q_sd[i],
                   state.v_sd[i]);
        };
        add(kinematic.state(), errors.kinematic[i]);
        add(model.state(), errors.model[i]);
      }
    }
    errors.restarts += model.restarts();
  }
  return errors;
}

}  // namespace plumb
