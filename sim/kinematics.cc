#include "sim/kinematics.h"

#include <Eigen/Geometry>
#include <stdexcept>

namespace plumb {

std::vector<Pose> LinkPoses(const RobotDescription& description, const Eigen::Ref<const Eigen::VectorXd>& q) {
  if (q.size() != description.num_positions()) {
    throw std::invalid_argument("the robot has " + std::to_string(description.num_positions()) +
                                " coordinates, not " + std::to_string(q.size()));
  }
  std::vector<Pose> poses(description.links.size());
  Eigen::Index next = 0;
  for (const JointDescription& joint : description.joints) {
    const Pose& parent = poses.at(static_cast<size_t>(joint.parent));
    Pose& child = poses.at(static_cast<size_t>(joint.child));
    child.rotation = parent.rotation * joint.rotation;
    child.position = parent.position + parent.rotation * joint.origin;
    switch (joint.type) {
      case JointDescription::Type::kPrismatic:
        child.position += child.rotation * joint.axis * q[next];
        break;
      case JointDescription::Type::kSpherical:
        child.rotation *=
            Eigen::Quaterniond(q[next], q[next + 1], q[next + 2], q[next + 3]).normalized().toRotationMatrix();
        break;
      case JointDescription::Type::kRevolute:
      case JointDescription::Type::kContinuous:
        child.rotation *= Eigen::AngleAxisd(q[next], joint.axis).toRotationMatrix();
        break;
    }
    next += joint.num_positions();
  }
  return poses;
}

}  // namespace plumb
