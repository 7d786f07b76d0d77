#include "robot/imu_mounting.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "robot/joint_tree.h"
#include "robot/twist_angle.h"

namespace plumb {

ImuMounting MountingOf(const RobotDescription& robot, int link) {
  using Type = JointDescription::Type;
  ImuMounting mounting;
  const std::vector<int> chain = ChainTo(robot, link);
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  // of the joint's axes, in the base's
  for (const int index : chain) {
    const JointDescription& joint = robot.joints[static_cast<size_t>(index)];
    rotation = rotation * joint.rotation;
    if (joint.type == Type::kPrismatic) {
      mounting.slides.push_back({index, rotation * joint.axis});
      continue;
    }
    const bool turns = joint.type == Type::kRevolute || joint.type == Type::kContinuous;
    if (index != chain.back() || !turns || !joint.passive) return {};
    mounting.turned = index;
    mounting.axis = joint.axis;
  }
  mounting.unturned = Eigen::Quaterniond(rotation);
  for (size_t i = 0; i < mounting.slides.size(); ++i) {
    for (size_t k = 0; k < i; ++k) {
      if (std::abs(mounting.slides[i].direction.dot(mounting.slides[k].direction)) > 1e-9) {
        mounting.slides.clear();
        return mounting;
      }
    }
  }
  return mounting;
}

double ImuMounting::Angle(const Eigen::Quaterniond& link_to_world) const {
  return std::remainder(TwistAngle(unturned.conjugate() * link_to_world, axis),
                        2 * std::numbers::pi);
}

}  // namespace plumb
