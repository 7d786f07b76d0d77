#include "sim/tasks/walk.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>

#include "robot/contact_points.h"
#include "robot/drive_effort.h"
#include "robot/kinematics.h"

namespace plumb {
namespace {

using Type = JointDescription::Type;

constexpr int kBaseJoints = 4, kBaseQ = 7, kBaseV = 6;
constexpr double kTracking = 0.25;  // [m^2/s^2]
constexpr double kStartNoise = 0.1;
constexpr double kSteepest = 0.5;  // cosine of the trunk's lean
constexpr double kLowest = 0.5;    // of the standing height

bool IsLegged(const RobotDescription& description) {
  if (description.num_joints() <= kBaseJoints) return false;
  for (int i = 0; i < description.num_joints(); ++i) {
    const JointDescription& joint = description.joints[static_cast<size_t>(i)];
    const Type type = joint.type;
    const bool fits = i < 3             ? type == Type::kPrismatic
                      : i < kBaseJoints ? type == Type::kSpherical
                                        : type == Type::kRevolute || type == Type::kContinuous;
    if (!fits || joint.passive != (i < kBaseJoints)) return false;
  }
  return true;
}

std::vector<std::string> ObservationNames(const RobotDescription& description) {
  std::vector<std::string> names;
  for (const char* of : {"gravity/", "v/base/", "rate/base/"}) {
    const char* unit = *of == 'v' ? " [m/s]" : *of == 'r' ? " [rad/s]" : "";
    for (const char* axis : {"x", "y", "z"}) names.push_back(std::string(of) + axis + unit);
  }
  names.emplace_back("height [m]");
  for (const char* of : {"e/", "v/"}) {
    for (const JointDescription& joint : description.joints) {
      if (!joint.passive) names.push_back(of + joint.name + (*of == 'e' ? " [rad]" : " [rad/s]"));
    }
  }
  return names;
}

/// Of what a step of walking makes of each: 0.1 m and 0.1 rad of the trunk, 0.5 rad of the legs;
/// half a metre and a radian a second, 5 rad/s.
Eigen::VectorXd StateScale(const RobotDescription& description) {
  const Eigen::Index n = description.num_velocities();
  Eigen::VectorXd scale = Eigen::VectorXd::Constant(2 * n, 5);
  scale.head(n).setConstant(0.5);
  scale.head(std::min<Eigen::Index>(n, kBaseV)).setConstant(0.1);
  scale.segment(n, std::min<Eigen::Index>(n, 3)).setConstant(0.5);
  if (n >= kBaseV) scale.segment(n + 3, 3).setConstant(1);
  return scale;
}

Eigen::Quaterniond Orientation(const Task::State& q) {
  return Eigen::Quaterniond(q[3], q[4], q[5], q[6]).normalized();
}

}  // namespace

WalkTask::WalkTask(const RobotDescription& description, const std::string& name,
                   const Eigen::Vector3d& command)
    : Task(description, ObservationNames(description), StateScale(description)),
      command_(command),
      period_(description.task.period),
      height_(0) {
  if (!IsLegged(description)) {
    throw std::invalid_argument(
        "task '" + name + "' needs a floating base without motors, then turning joints with; '" +
        description.name + "' has others");
  }
  const auto driven = static_cast<Eigen::Index>(action_size());
  rest_.resize(driven), drives_.reserve(static_cast<size_t>(driven));
  for (Eigen::Index i = 0; i < driven; ++i) {
    const JointDescription& joint = description.joints[static_cast<size_t>(kBaseJoints + i)];
    rest_[i] = joint.dynamics.rest;
    drives_.push_back({joint.dynamics, joint.effort_limit});
  }
  Eigen::VectorXd q(description.num_positions());
  q << 0, 0, 0, 1, 0, 0, 0, rest_;
  const std::vector<Pose> poses = LinkPoses(description, q);
  for (const ContactPoint& point : ContactPoints(description)) {
    const Pose& pose = poses[static_cast<size_t>(point.link)];
    const double lowest = (pose.position + pose.rotation * point.centre).z() - point.radius;
    height_ = std::max(height_, -lowest);
  }
}

void WalkTask::Observe(const State& q, const State& v, std::span<float> observation) const {
  const Eigen::Quaterniond to_trunk = Orientation(q).conjugate();
  Eigen::Map<Eigen::VectorXf> out(observation.data(),
                                  static_cast<Eigen::Index>(observation.size()));
  out.segment<3>(0) = (to_trunk * -Eigen::Vector3d::UnitZ()).cast<float>();
  out.segment<3>(3) = (to_trunk * v.head<3>()).cast<float>();
  out.segment<3>(6) = v.segment<3>(3).cast<float>();
  out[9] = static_cast<float>(q[2]);
  out.segment(10, rest_.size()) = (q.tail(rest_.size()) - rest_).cast<float>();
  out.tail(rest_.size()) = v.tail(rest_.size()).cast<float>();
}

double WalkTask::Reward(const State&, const State& v, const State& effort, const State& next_q,
                        const State& next_v) const {
  if (Terminated(next_q, next_v)) return 0;
  const Eigen::Quaterniond to_trunk = Orientation(next_q).conjugate();
  const Eigen::Vector3d velocity = to_trunk * next_v.head<3>();
  const Eigen::Vector3d rate = next_v.segment<3>(3);
  const Eigen::Vector3d gravity = to_trunk * -Eigen::Vector3d::UnitZ();
  const auto angle = next_q.tail(rest_.size()), speed = next_v.tail(rest_.size());
  const double off = (velocity.head<2>() - command_.head<2>()).squaredNorm();
  const double off_turn = rate.z() - command_.z();
  double torques = 0;
  for (Eigen::Index i = 0; i < rest_.size(); ++i) {
    const auto& [dynamics, limit] = drives_[static_cast<size_t>(i)];
    const double torque =
        DriveEffort(dynamics, limit, effort.tail(rest_.size())[i], angle[i], speed[i]);
    torques += torque * torque;
  }
  const double accelerations = (speed - v.tail(rest_.size())).squaredNorm() / (period_ * period_);
  return std::exp(-off / kTracking) + 0.5 * std::exp(-off_turn * off_turn / kTracking) -
         2 * velocity.z() * velocity.z() - 0.05 * rate.head<2>().squaredNorm() -
         5 * gravity.head<2>().squaredNorm() - 2e-4 * torques - 2.5e-7 * accelerations -
         0.1 * (angle - rest_).squaredNorm() / static_cast<double>(rest_.size());
}

bool WalkTask::Terminated(const State& q, const State& v) const {
  if (!q.allFinite() || !v.allFinite()) return true;
  const double lean = (Orientation(q) * Eigen::Vector3d::UnitZ()).z();
  return lean < kSteepest || q[2] < kLowest * height_;
}

void WalkTask::InitialState(Random& random, Eigen::Ref<Eigen::VectorXd> q,
                            Eigen::Ref<Eigen::VectorXd> v) const {
  const double half_heading = random.Uniform(-std::numbers::pi, std::numbers::pi) / 2;
  q.head<kBaseQ>() << 0, 0, height_, std::cos(half_heading), 0, 0, std::sin(half_heading);
  v.setZero();
  for (Eigen::Index i = 0; i < rest_.size(); ++i) {
    q[kBaseQ + i] = rest_[i] + random.Uniform(-kStartNoise, kStartNoise);
    v[kBaseV + i] = random.Uniform(-kStartNoise, kStartNoise);
  }
}

}  // namespace plumb
