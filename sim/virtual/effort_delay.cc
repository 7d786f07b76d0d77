#include "sim/virtual/effort_delay.h"

#include <algorithm>
#include <limits>

#include "common/time_units.h"

namespace plumb {

EffortDelay::EffortDelay(const RobotDescription& robot)
    : delay_(static_cast<size_t>(robot.num_velocities()), 0),
      coming_(delay_.size()),
      acting_(Eigen::VectorXd::Zero(robot.num_velocities())) {
  for (const UnmodelledJoint& unmodelled : robot.virtual_robot.joints) {
    delay_[static_cast<size_t>(robot.velocity_of(unmodelled.joint))] =
        Microseconds(unmodelled.delay);
  }
}

void EffortDelay::Make(Eigen::Index velocity, double effort, int64_t now) {
  const auto i = static_cast<size_t>(velocity);
  if (delay_[i] == 0) {
    acting_[velocity] = effort;
    return;
  }
  const double latest = coming_[i].empty() ? acting_[velocity] : coming_[i].back().effort;
  if (effort != latest) coming_[i].push_back({now + delay_[i], effort});
}

int64_t EffortDelay::NextChange() const {
  int64_t next = std::numeric_limits<int64_t>::max();
  for (const auto& changes : coming_) {
    if (!changes.empty()) next = std::min(next, changes.front().at);
  }
  return next;
}

void EffortDelay::Take(int64_t now) {
  for (size_t i = 0; i < coming_.size(); ++i) {
    for (; !coming_[i].empty() && coming_[i].front().at <= now; coming_[i].pop_front()) {
      acting_[static_cast<Eigen::Index>(i)] = coming_[i].front().effort;
    }
  }
}

void EffortDelay::Clear() {
  acting_.setZero();
  for (auto& changes : coming_) changes.clear();
}

}  // namespace plumb
