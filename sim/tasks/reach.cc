#include "sim/tasks/reach.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace plumb {
namespace {

using Type = JointDescription::Type;

constexpr double kSpeedWeight = 0.01, kEffortWeight = 0.01;
constexpr double kSpeedScale = 8;  // [1/s] times the position's scale

bool Endless(const JointDescription& joint) { return joint.type == Type::kContinuous; }

double Scale(const JointDescription& joint) {
  const double half_range = (joint.upper - joint.lower) / 2;
  return joint.type == Type::kPrismatic && std::isfinite(half_range) ? half_range : 1;
}

int ObservationSize(const RobotDescription& description) {
  return 2 * description.num_joints() +
         static_cast<int>(std::count_if(description.joints.begin(), description.joints.end(), Endless));
}

Eigen::VectorXd StateScale(const RobotDescription& description) {
  const int n = description.num_joints();
  Eigen::VectorXd scale(2 * n);
  for (int i = 0; i < n; ++i) {
    scale[i] = Scale(description.joints[static_cast<size_t>(i)]);
    scale[n + i] = kSpeedScale * scale[i];
  }
  return scale;
}

}  // namespace

ReachTask::ReachTask(const RobotDescription& description, const std::string& name)
    : Task(description, ObservationSize(description), StateScale(description)) {
  const TaskSettings& settings = description.task;
  for (size_t i = 0; i < description.joints.size(); ++i) {
    const JointDescription& joint = description.joints[i];
    const auto fail = [&](const std::string& what) {
      throw std::invalid_argument("task '" + name + "': joint '" + joint.name + "' " + what);
    };
    if (joint.type == Type::kSpherical) fail("is spherical, which this task cannot aim at");
    const double target = i < settings.target.size() ? settings.target[i] : 0;
    const double spread = i < settings.spread.size() ? settings.spread[i] : 0;
    Coordinate c{Endless(joint), target, Scale(joint), joint.lower, joint.upper};
    if (spread > 0) {
      c.lower = std::max(joint.lower, target - spread);
      c.upper = std::min(joint.upper, target + spread);
    } else if (name == "hold") {
      c.lower = c.upper = target;
    } else if (c.endless) {
      c.lower = -std::numbers::pi;
      c.upper = std::numbers::pi;
    } else if (!std::isfinite(c.upper - c.lower)) {
      fail("has no limits to start between: give it a task.spread");
    }
    coordinates_.push_back(c);
  }
}

double ReachTask::Error(size_t i, double q) const {
  const Coordinate& c = coordinates_[i];
  return c.endless ? WrapAngle(q - c.target) : q - c.target;
}

void ReachTask::Observe(const State& q, const State& v, std::span<float> observation) const {
  size_t next = 0;
  for (size_t i = 0; i < coordinates_.size(); ++i) {
    const double error = q[static_cast<Eigen::Index>(i)] - coordinates_[i].target;
    if (coordinates_[i].endless) {
      observation[next++] = static_cast<float>(std::sin(error));
      observation[next++] = static_cast<float>(std::cos(error));
    } else {
      observation[next++] = static_cast<float>(error);
    }
  }
  for (const double speed : v) observation[next++] = static_cast<float>(speed);
}

double ReachTask::Reward(const State& q, const State& v, const State& effort, const State&, const State&) const {
  double cost = 0;
  for (size_t i = 0; i < coordinates_.size(); ++i) {
    const auto index = static_cast<Eigen::Index>(i);
    const double error = Error(i, q[index]) / coordinates_[i].scale;
    const double speed = v[index] / coordinates_[i].scale;
    cost += error * error + kSpeedWeight * speed * speed;
  }
  for (int i = 0; i < action_size(); ++i) {
    const double part = effort[action_indices()[static_cast<size_t>(i)]] / effort_limits()[i];
    cost += kEffortWeight * part * part;
  }
  return -cost;
}

void ReachTask::InitialState(Random& random, Eigen::Ref<Eigen::VectorXd> q,
                             Eigen::Ref<Eigen::VectorXd> v) const {
  for (size_t i = 0; i < coordinates_.size(); ++i) {
    q[static_cast<Eigen::Index>(i)] = random.Uniform(coordinates_[i].lower, coordinates_[i].upper);
  }
  v.setZero();
}

}  // namespace plumb
