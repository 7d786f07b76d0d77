#include "sim/tasks/reach.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "robot/rotation_vector.h"

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

/// e/<joint> are the differences to the target.
std::vector<std::string> ObservationNames(const RobotDescription& description) {
  std::vector<std::string> names;
  for (const JointDescription& joint : description.joints) {
    const std::string error = "e/" + joint.name;
    if (joint.type == Type::kSpherical) {
      for (const char* axis : {"/x", "/y", "/z"}) names.push_back(error + axis + " [rad]");
    } else if (Endless(joint)) {
      names.push_back("sin(" + error + ")");
      names.push_back("cos(" + error + ")");
    } else {
      names.push_back(error + (joint.type == Type::kPrismatic ? " [m]" : " [rad]"));
    }
  }
  for (std::string& name : VelocityNames(description)) names.push_back(std::move(name));
  return names;
}

Eigen::VectorXd StateScale(const RobotDescription& description) {
  const Eigen::Index n = description.num_velocities();
  Eigen::VectorXd scale(2 * n);
  Eigen::Index at = 0;
  for (const JointDescription& joint : description.joints) {
    scale.segment(at, joint.num_velocities()).setConstant(Scale(joint));
    scale.segment(n + at, joint.num_velocities()).setConstant(kSpeedScale * Scale(joint));
    at += joint.num_velocities();
  }
  return scale;
}

Eigen::Quaterniond Quaternion(const double* wxyz) { return {wxyz[0], wxyz[1], wxyz[2], wxyz[3]}; }

/// Any orientation, all as likely: Shoemake, "Uniform random rotations", Graphics Gems III, 1992.
Eigen::Quaterniond AnyOrientation(Random& random) {
  const double part = random.Uniform();
  const double one = random.Uniform(-std::numbers::pi, std::numbers::pi);
  const double other = random.Uniform(-std::numbers::pi, std::numbers::pi);
  const double a = std::sqrt(1 - part), b = std::sqrt(part);
  return {a * std::cos(one), a * std::sin(one), b * std::cos(other), b * std::sin(other)};
}

}  // namespace

ReachTask::ReachTask(const RobotDescription& description, const std::string& name)
    : Task(description, ObservationNames(description), StateScale(description)) {
  const TaskSettings& settings = description.task;
  for (int i = 0; i < description.num_joints(); ++i) {
    const JointDescription& joint = description.joints[static_cast<size_t>(i)];
    Joint j;
    j.type = joint.type;
    j.q = description.position_of(i);
    j.v = description.velocity_of(i);
    j.scale = Scale(joint);
    const auto at = static_cast<size_t>(j.q);
    const double spread = at < settings.spread.size() ? settings.spread[at] : 0;
    if (joint.type == Type::kSpherical) {
      if (at + 4 <= settings.target.size()) j.orientation = Quaternion(&settings.target[at]);
      j.lower = -spread;
      j.upper = spread;
      j.anywhere = !(spread > 0) && name != "hold";
    } else {
      j.target = at < settings.target.size() ? settings.target[at] : 0;
      j.lower = joint.lower;
      j.upper = joint.upper;
      if (spread > 0) {
        j.lower = std::max(joint.lower, j.target - spread);
        j.upper = std::min(joint.upper, j.target + spread);
      } else if (name == "hold") {
        j.lower = j.upper = j.target;
      } else if (Endless(joint)) {
        j.lower = -std::numbers::pi;
        j.upper = std::numbers::pi;
      } else if (!std::isfinite(j.upper - j.lower)) {
        throw std::invalid_argument("task '" + name + "': joint '" + joint.name +
                                    "' has no limits to start between: give it a task.spread");
      }
    }
    joints_.push_back(j);
  }
}

Eigen::Vector3d ReachTask::Turn(const Joint& joint, const State& q) {
  return ToRotationVector(joint.orientation.conjugate() * Quaternion(q.data() + joint.q));
}

double ReachTask::Distance(size_t index, const State& q) const {
  const Joint& joint = joints_[index];
  if (joint.type == Type::kSpherical) return Turn(joint, q).norm();
  const double difference = q[joint.q] - joint.target;
  return std::abs(joint.type == Type::kContinuous ? WrapAngle(difference) : difference);
}

void ReachTask::Observe(const State& q, const State& v, std::span<float> observation) const {
  size_t next = 0;
  for (const Joint& joint : joints_) {
    if (joint.type == Type::kSpherical) {
      for (const double entry : Turn(joint, q)) observation[next++] = static_cast<float>(entry);
      continue;
    }
    const double error = q[joint.q] - joint.target;
    if (joint.type == Type::kContinuous) {
      observation[next++] = static_cast<float>(std::sin(error));
      observation[next++] = static_cast<float>(std::cos(error));
    } else {
      observation[next++] = static_cast<float>(error);
    }
  }
  for (const double speed : v) observation[next++] = static_cast<float>(speed);
}

double ReachTask::Reward(const State& q, const State& v, const State& effort, const State&,
                         const State&) const {
  double cost = 0;
  for (const Joint& joint : joints_) {
    if (joint.type == Type::kSpherical) {
      cost += Turn(joint, q).squaredNorm() + kSpeedWeight * v.segment<3>(joint.v).squaredNorm();
      continue;
    }
    const double difference = q[joint.q] - joint.target;
    const double error =
        (joint.type == Type::kContinuous ? WrapAngle(difference) : difference) / joint.scale;
    const double speed = v[joint.v] / joint.scale;
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
  for (const Joint& joint : joints_) {
    if (joint.type != Type::kSpherical) {
      q[joint.q] = random.Uniform(joint.lower, joint.upper);
      continue;
    }
    Eigen::Quaterniond start;
    if (joint.anywhere) {
      start = AnyOrientation(random);
    } else {
      Eigen::Vector3d turn;
      for (double& entry : turn) entry = random.Uniform(joint.lower, joint.upper);
      start = joint.orientation * FromRotationVector(turn);
    }
    q.segment<4>(joint.q) << start.w(), start.x(), start.y(), start.z();
  }
  v.setZero();
}

}  // namespace plumb
