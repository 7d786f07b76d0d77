#include "controller/policy_fit.h"

#include <fmt/format.h>

#include <stdexcept>

namespace plumb {

void RequireFit(const GaussianPolicy& policy, const RobotDescription& robot, const Task& task) {
  if (policy.shape().observations != task.observation_size() ||
      policy.shape().actions != task.action_size()) {
    throw std::invalid_argument(
        fmt::format("the policy is for another robot or task: it turns {} observations into {} "
                    "actions, '{}' of robot '{}' has {} and {}",
                    policy.shape().observations, policy.shape().actions, robot.task.name,
                    robot.name, task.observation_size(), task.action_size()));
  }
  const Eigen::ArrayXf limits = robot.effort_limits().cast<float>();
  if (((policy.action_scale.array() - limits).abs() > 1e-4f * limits).any()) {
    throw std::invalid_argument(
        "the policy is for other effort limits: an action of 1 would be another effort");
  }
}

}  // namespace plumb
