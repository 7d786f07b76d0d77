#pragma once

#include <Eigen/Dense>
#include <cstdlib>
#include <string>
#include <vector>

#include "calibrator/motion/transitions.h"
#include "common/random.h"
#include "robot/description.h"
#include "sim/environment.h"

namespace plumb {

inline RobotDescription Hopper(const std::string& file = "/gym.toml") {
  return LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/hopper" + file);
}

/// Masses drawn uniformly from [1, 5] kg.
inline Eigen::VectorXd RandomMasses(const RobotDescription& robot, uint32_t stream) {
  Random random(41, {stream});
  Eigen::VectorXd masses(static_cast<Eigen::Index>(robot.parameters.size()));
  for (double& mass : masses) mass = random.Uniform(1, 5);
  return masses;
}

/// Episodes under random actions until there are so many transitions: states exact, noise of known
/// variance on s'.
inline std::vector<Rollout> RandomRollouts(const RobotDescription& robot,
                                           const Eigen::VectorXd& truth, int transitions,
                                           double noise_variance, uint32_t stream,
                                           int longest = 1000, double amplitude = 1) {
  Environment environment(robot);
  environment.SetParameters(truth);
  Random random(43, {stream});
  std::vector<Rollout> rollouts;
  const Eigen::Index n = robot.num_velocities();
  const double sd = std::sqrt(noise_variance);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int count = 0; count < transitions;) {
    environment.Reset(random);
    Rollout rollout;
    rollout.episode = static_cast<int64_t>(rollouts.size());
    for (int step = 0; step < longest && count < transitions; ++step, ++count) {
      Transition t;
      t.step = step;
      t.q = environment.q(), t.v = environment.v();
      Eigen::VectorXf action(environment.action_size());
      for (float& a : action) a = static_cast<float>(random.Uniform(-amplitude, amplitude));
      const bool over = environment.Step(action).terminated;
      t.efforts = {{robot.task.period, environment.effort()}};
      t.next_q = environment.q(), t.next_v = environment.v();
      for (double& x : t.next_q) x += sd * random.Normal();
      for (double& x : t.next_v) x += sd * random.Normal();
      t.q_sd = t.v_sd = Eigen::VectorXd::Zero(n);
      t.next_q_sd = t.next_v_sd = Eigen::VectorXd::Constant(n, nan);
      rollout.transitions.push_back(t);
      if (over) {
        ++count;
        break;
      }
    }
    rollouts.push_back(std::move(rollout));
  }
  return rollouts;
}

}  // namespace plumb
