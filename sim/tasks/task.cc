#include "sim/tasks/task.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

namespace plumb {

Task::Task(const RobotDescription& description, std::vector<std::string> observation_names,
           Eigen::VectorXd state_scale)
    : observation_names_(std::move(observation_names)),
      state_scale_(std::move(state_scale)),
      effort_limits_(description.effort_limits()),
      num_efforts_(description.num_velocities()) {
  for (const int i : description.driven()) {
    const JointDescription& joint = description.joints[static_cast<size_t>(i)];
    if (joint.num_velocities() != 1) {
      throw std::invalid_argument("joint '" + joint.name +
                                  "' cannot be driven: one motor turns about one axis");
    }
    action_names_.push_back(joint.name);
    action_indices_.push_back(description.velocity_of(i));
  }
}

double Task::action_unit(int) const { return 1; }

bool Task::Terminated(const State&, const State&) const { return false; }

void Task::Effort(std::span<const float> action, Eigen::Ref<Eigen::VectorXd> effort) const {
  if (static_cast<int>(action.size()) != action_size() || effort.size() != num_efforts_) {
    throw std::invalid_argument("an action has one entry per driven joint: " +
                                std::to_string(action_size()));
  }
  effort.setZero();
  for (int i = 0; i < action_size(); ++i) {
    const double a = action[static_cast<size_t>(i)];
    if (std::isnan(a)) continue;
    effort[action_indices_[static_cast<size_t>(i)]] = std::clamp(a, -1.0, 1.0) * effort_limits_[i];
  }
}

double WrapAngle(double angle) {
  constexpr double kPi = std::numbers::pi;
  return angle - 2 * kPi * std::floor((angle + kPi) / (2 * kPi));
}

std::vector<std::string> VelocityNames(const RobotDescription& description) {
  std::vector<std::string> names;
  for (const JointDescription& joint : description.joints) {
    if (joint.type == JointDescription::Type::kSpherical) {
      for (const char* axis : {"/x", "/y", "/z"})
        names.push_back("v/" + joint.name + axis + " [rad/s]");
    } else {
      names.push_back("v/" + joint.name +
                      (joint.type == JointDescription::Type::kPrismatic ? " [m/s]" : " [rad/s]"));
    }
  }
  return names;
}

}  // namespace plumb
