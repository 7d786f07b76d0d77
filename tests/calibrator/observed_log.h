#pragma once

#include <cmath>
#include <string>
#include <vector>

#include "calibrator/motion/log.h"
#include "estimator/state_observer.h"
#include "tests/estimator/simulated_readings.h"

namespace plumb {

using Samples = std::vector<SimulatedReadings::Sample>;

/// Which estimate of a simulated motion's states calibration is given.
enum class States {
  kTrue,      ///< the truth, with next to no uncertainty
  kSmoothed,  ///< the smoother's, as plumb-calibrator has them
  kCausal,    ///< the causal estimate, as the controller has it
  /// the smoother's, but taken for exact where a transition begins: no errors in variables
  kCertain,
};

/// A motion that was controlled every robot.task.period as a log has it, as this episode.
inline Rollout Observed(const RobotDescription& robot, const Samples& motion, States states,
                        int64_t episode = 0) {
  const auto n = static_cast<size_t>(robot.num_joints());
  const int64_t per_control = std::llround(robot.task.period * 1e6) / SimulatedReadings::kPeriod;
  StateObserver observer(robot);
  TransitionJoiner joiner = TransitionJoiner::Unbounded(robot);
  joint_command_t command{};
  command.num_joints = static_cast<int32_t>(n);
  command.effort.assign(n, 0);
  for (const SimulatedReadings::Sample& sample : motion) {
    for (const imu_t& imu : sample.imus) observer.OnImu(imu);
    observer.OnJointState(sample.joints);
    if (states == States::kTrue) {
      robot_state_t state = observer.state();
      for (size_t i = 0; i < n; ++i) {
        state.q[i] = sample.q[static_cast<Eigen::Index>(i)];
        state.v[i] = sample.v[static_cast<Eigen::Index>(i)];
        state.q_sd[i] = state.v_sd[i] = 1e-7;
      }
      joiner.OnState(state);
    } else if (states == States::kCausal) {
      joiner.OnState(observer.state());
    } else {
      for (const robot_state_t& state : observer.smoothed()) joiner.OnState(state);
    }
    if (sample.joints.sequence % per_control != 0) continue;
    command.state_sequence = sample.joints.sequence;
    joiner.OnCommand(command);
    ++command.step;
  }
  Rollout rollout = joiner.Join(0, command.state_sequence + per_control);
  rollout.episode = episode;
  if (states == States::kCertain) {
    for (Transition& transition : rollout.transitions) {
      transition.q_sd.setZero();
      transition.v_sd.setZero();
    }
  }
  return rollout;
}

/// The log of motions, an episode each.
inline Log ObservedLog(const RobotDescription& robot, const std::vector<Samples>& motions,
                       States states) {
  Log log;
  log.name = "simulated";
  for (size_t i = 0; i < motions.size(); ++i) {
    log.rollouts.push_back(Observed(robot, motions[i], states, static_cast<int64_t>(i)));
  }
  return log;
}
inline Log ObservedLog(const RobotDescription& robot, const Samples& motion, States states) {
  return ObservedLog(robot, std::vector<Samples>{motion}, states);
}

/// A combination of a robot's parameters that a motion can tell: a name, and the powers of the
/// parameters whose product it is.
struct Knowable {
  std::string name;
  Eigen::VectorXd power;
};
inline std::vector<Knowable> KnowableOf(const RobotDescription& robot) {
  if (robot.parameters.size() == 3)
    return {{"g/l", Eigen::Vector3d(1, 0, -1)}, {"m l^2", Eigen::Vector3d(0, 1, 2)}};
  std::vector<Knowable> masses;
  for (size_t i = 0; i < robot.parameters.size(); ++i) {
    masses.push_back({robot.parameters[i].name,
                      Eigen::VectorXd::Unit(static_cast<Eigen::Index>(robot.parameters.size()),
                                            static_cast<Eigen::Index>(i))});
  }
  return masses;
}

}  // namespace plumb
