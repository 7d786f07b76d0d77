#include "sim/tasks/task.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

namespace plumb {

Task::Task(const RobotDescription& description, int observation_size, Eigen::VectorXd state_scale)
    : observation_size_(observation_size),
      state_scale_(std::move(state_scale)),
      effort_limits_(description.effort_limits()) {}

bool Task::Terminated(const State&, const State&) const { return false; }

void Task::Effort(std::span<const float> action, Eigen::Ref<Eigen::VectorXd> effort) const {
  if (static_cast<int>(action.size()) != action_size() || effort.size() != action_size()) {
    throw std::invalid_argument("an action has one entry per joint: " + std::to_string(action_size()));
  }
  for (int i = 0; i < action_size(); ++i) {
    const double a = action[static_cast<size_t>(i)];
    effort[i] = std::isnan(a) ? 0 : std::clamp(a, -1.0, 1.0) * effort_limits_[i];
  }
}

}  // namespace plumb
