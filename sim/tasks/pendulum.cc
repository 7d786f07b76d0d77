#include "sim/tasks/pendulum.h"

#include <cmath>
#include <numbers>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace plumb {

namespace {

/// Of any robot: it is looked at more closely afterwards.
std::vector<std::string> ObservationNames(const RobotDescription& description) {
  std::vector<std::string> names;
  for (const JointDescription& joint : description.joints) {
    names.push_back("cos(q/" + joint.name + ")");
    names.push_back("sin(q/" + joint.name + ")");
  }
  for (std::string& name : VelocityNames(description)) names.push_back(std::move(name));
  return names;
}

}  // namespace

PendulumTask::PendulumTask(const RobotDescription& description)
    : Task(description, ObservationNames(description), Eigen::Vector2d(1, 8)) {
  using Type = JointDescription::Type;
  if (description.num_joints() != 1 || description.joints[0].type == Type::kPrismatic ||
      description.joints[0].type == Type::kSpherical || description.joints[0].passive) {
    throw std::invalid_argument(
        "task 'pendulum' needs a robot with one turning joint and its motor; '" + description.name +
        "' is none");
  }
}

void PendulumTask::Observe(const State& q, const State& v, std::span<float> observation) const {
  observation[0] = static_cast<float>(std::cos(q[0]));
  observation[1] = static_cast<float>(std::sin(q[0]));
  observation[2] = static_cast<float>(v[0]);
}

double PendulumTask::Reward(const State& q, const State& v, const State& effort, const State&,
                            const State&) const {
  const double angle = WrapAngle(q[0]);
  return -(angle * angle + 0.1 * v[0] * v[0] + 0.001 * effort[0] * effort[0]);
}

void PendulumTask::InitialState(Random& random, Eigen::Ref<Eigen::VectorXd> q,
                                Eigen::Ref<Eigen::VectorXd> v) const {
  q[0] = random.Uniform(-std::numbers::pi, std::numbers::pi);
  v[0] = random.Uniform(-1, 1);
}

}  // namespace plumb
