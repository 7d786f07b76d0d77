#include "sim/tasks/stand.h"

#include <numbers>
#include <stdexcept>

#include "robot/roll_pitch_yaw.h"

namespace plumb {
namespace {

constexpr double kDrop = 0.03;  // [m]
constexpr double kLean = 0.1;
constexpr double kJointNoise = 0.2;

}  // namespace

StandTask::StandTask(const RobotDescription& description)
    : WalkTask(description, "stand", Eigen::Vector3d::Zero()) {
  for (const double velocity : description.task.velocity) {
    if (velocity != 0)
      throw std::invalid_argument("task 'stand' goes nowhere: [task] velocity is for 'walk'");
  }
}

void StandTask::InitialState(Random& random, Eigen::Ref<Eigen::VectorXd> q,
                             Eigen::Ref<Eigen::VectorXd> v) const {
  const double heading = random.Uniform(-std::numbers::pi, std::numbers::pi);
  const double pitch = random.Uniform(-kLean, kLean), roll = random.Uniform(-kLean, kLean);
  const Eigen::Quaterniond turned = FromRollPitchYaw({roll, pitch, heading});
  q.head<7>() << 0, 0, standing_height() + kDrop, turned.w(), turned.vec();
  v.setZero();
  const Eigen::Index joints = rest().size();
  for (Eigen::Index i = 0; i < joints; ++i) {
    q.tail(joints)[i] = rest()[i] + random.Uniform(-kJointNoise, kJointNoise);
    v.tail(joints)[i] = random.Uniform(-kJointNoise, kJointNoise);
  }
}

}  // namespace plumb
