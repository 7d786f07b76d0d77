#include "sim/tasks/hopper.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace plumb {
namespace {

constexpr int kCoordinates = 6;
constexpr double kStandingHeight = 1.25;  // [m]
constexpr double kStartNoise = 0.005;
constexpr double kLowest = 0.7;    // [m]
constexpr double kSteepest = 0.2;  // [rad]
constexpr double kWildest = 100;   // any unit
constexpr double kSpeedClip = 10;
constexpr double kAliveBonus = 1;
constexpr double kActionCost = 1e-3;

bool IsHopper(const RobotDescription& description) {
  if (description.num_joints() != kCoordinates) return false;
  for (int i = 0; i < kCoordinates; ++i) {
    const JointDescription& joint = description.joints[static_cast<size_t>(i)];
    if (joint.type == JointDescription::Type::kSpherical) return false;
    if ((joint.type == JointDescription::Type::kPrismatic) != (i < 2)) return false;
    if (joint.passive != (i < 3)) return false;
  }
  return true;
}

Eigen::VectorXd StateScale() {
  return (Eigen::VectorXd(2 * kCoordinates) << 1, 0.5, 0.2, 1, 1, 1, 2, 2, 2, 10, 10, 10)
      .finished();
}

/// Of any robot: it is looked at more closely afterwards.
std::vector<std::string> ObservationNames(const RobotDescription& description) {
  std::vector<std::string> names;
  for (size_t i = 1; i < description.joints.size(); ++i) {
    const JointDescription& joint = description.joints[i];
    names.push_back("q/" + joint.name +
                    (joint.type == JointDescription::Type::kPrismatic ? " [m]" : " [rad]"));
  }
  for (std::string& name : VelocityNames(description)) names.push_back(std::move(name));
  return names;
}

}  // namespace

HopperTask::HopperTask(const RobotDescription& description)
    : Task(description, ObservationNames(description), StateScale()),
      period_(description.task.period) {
  if (!IsHopper(description)) {
    throw std::invalid_argument(
        "task 'hopper' needs two slides and a turning joint without motors, then three turning "
        "joints with; '" +
        description.name + "' has others");
  }
}

void HopperTask::Observe(const State& q, const State& v, std::span<float> observation) const {
  auto next = observation.begin();
  for (int i = 1; i < kCoordinates; ++i) *next++ = static_cast<float>(q[i]);
  for (int i = 0; i < kCoordinates; ++i)
    *next++ = static_cast<float>(std::clamp(v[i], -kSpeedClip, kSpeedClip));
}

double HopperTask::Reward(const State& q, const State&, const State& effort, const State& next_q,
                          const State&) const {
  double squares = 0;
  for (int i = 0; i < action_size(); ++i) {
    const double action = effort[action_indices()[static_cast<size_t>(i)]] / action_unit(i);
    squares += action * action;
  }
  return (next_q[0] - q[0]) / period_ + kAliveBonus - kActionCost * squares;
}

bool HopperTask::Terminated(const State& q, const State& v) const {
  // Written so that what is not a number is no healthy state either.
  const bool tame = (q.tail(kCoordinates - 2).array().abs() < kWildest).all() &&
                    (v.array().abs() < kWildest).all() && std::isfinite(q[0]) &&
                    std::isfinite(q[1]);
  return !(tame && q[1] > kLowest && std::abs(q[2]) < kSteepest);
}

void HopperTask::InitialState(Random& random, Eigen::Ref<Eigen::VectorXd> q,
                              Eigen::Ref<Eigen::VectorXd> v) const {
  for (int i = 0; i < kCoordinates; ++i) q[i] = random.Uniform(-kStartNoise, kStartNoise);
  for (int i = 0; i < kCoordinates; ++i) v[i] = random.Uniform(-kStartNoise, kStartNoise);
  q[1] += kStandingHeight;
}

}  // namespace plumb
