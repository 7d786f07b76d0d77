#include "trainer/policy_file.h"

#include <fmt/format.h>

#include <optional>
#include <stdexcept>

#include "trainer/checkpoint.h"

namespace plumb {

GaussianPolicy LoadPolicy(const std::string& file, const RobotDescription& robot, const Task& task) {
  const auto fail = [&](const std::string& what) { throw std::invalid_argument(file + ": " + what); };
  const std::optional<Checkpoint> checkpoint = LoadCheckpoint(file);
  if (!checkpoint) fail("there is no such policy");
  std::optional<GaussianPolicy> policy;
  try {
    policy = GaussianPolicy::FromMessage(checkpoint->policy);
  } catch (const std::invalid_argument& error) {
    fail(error.what());
  }
  if (policy->shape().observations != task.observation_size() || policy->shape().actions != task.action_size()) {
    fail(fmt::format("the policy is for another robot or task: it turns {} observations into {} actions, '{}' of "
                     "robot '{}' has {} and {}",
                     policy->shape().observations, policy->shape().actions, robot.task.name, robot.name,
                     task.observation_size(), task.action_size()));
  }
  const Eigen::ArrayXf limits = robot.effort_limits().cast<float>();
  if (((policy->action_scale.array() - limits).abs() > 1e-4f * limits).any()) {
    fail("the policy is for other effort limits: an action of 1 would be another effort");
  }
  return *policy;
}

}  // namespace plumb
