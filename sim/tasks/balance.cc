#include "sim/tasks/balance.h"

#include <cmath>
#include <limits>
#include <stdexcept>

namespace plumb {
namespace {

constexpr double kEffortWeight = 0.01;

}  // namespace

BalanceTask::BalanceTask(const RobotDescription& description) : HoldTask(description) {
  const TaskSettings& settings = description.task;
  bool any = false;
  size_t at = 0;
  for (const JointDescription& joint : description.joints) {
    const double fall = at < settings.fall.size() ? settings.fall[at] : 0;
    const double spread = at < settings.spread.size() ? settings.spread[at] : 0;
    // A spherical joint's spread is of each entry of the rotation vector.
    const double furthest = joint.num_velocities() == 3 ? std::sqrt(3) * spread : spread;
    if (fall > 0 && furthest >= fall) {
      throw std::invalid_argument("task 'balance': joint '" + joint.name +
                                  "' may begin fallen: its task.spread reaches its task.fall");
    }
    any = any || fall > 0;
    fall_.push_back(fall > 0 ? fall : std::numeric_limits<double>::infinity());
    at += static_cast<size_t>(joint.num_positions());
  }
  if (!any) throw std::invalid_argument("task 'balance' needs a task.fall of some joint");
}

double BalanceTask::Reward(const State&, const State&, const State& effort, const State& next_q,
                           const State& next_v) const {
  double squares = 0;
  for (int i = 0; i < action_size(); ++i) {
    const double part = effort[action_indices()[static_cast<size_t>(i)]] / effort_limits()[i];
    squares += part * part;
  }
  return (Terminated(next_q, next_v) ? 0 : 1) - kEffortWeight * squares / action_size();
}

bool BalanceTask::Terminated(const State& q, const State& v) const {
  if (!q.allFinite() || !v.allFinite()) return true;
  for (size_t joint = 0; joint < fall_.size(); ++joint) {
    if (Distance(joint, q) > fall_[joint]) return true;
  }
  return false;
}

}  // namespace plumb
