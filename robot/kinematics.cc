#include "robot/kinematics.h"

#include <Eigen/Geometry>
#include <stdexcept>

namespace plumb {
namespace {

using Type = JointDescription::Type;

// Of the link that a joint moves. @param q the joint's first coordinate.
Pose Attach(const Pose& parent, const JointDescription& joint, const double* q) {
  Pose child;
  child.rotation = parent.rotation * joint.rotation;
  child.position = parent.position + parent.rotation * joint.origin;
  switch (joint.type) {
    case Type::kPrismatic:
      child.position += child.rotation * joint.axis * q[0];
      break;
    case Type::kSpherical:
      child.rotation *= Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
      break;
    case Type::kRevolute:
    case Type::kContinuous:
      child.rotation *= Eigen::AngleAxisd(q[0], joint.axis).toRotationMatrix();
      break;
  }
  return child;
}

}  // namespace

std::vector<Pose> LinkPoses(const RobotDescription& description,
                            const Eigen::Ref<const Eigen::VectorXd>& q) {
  if (q.size() != description.num_positions()) {
    throw std::invalid_argument("the robot has " + std::to_string(description.num_positions()) +
                                " coordinates, not " + std::to_string(q.size()));
  }
  std::vector<Pose> poses(description.links.size());
  Eigen::Index next = 0;
  for (const JointDescription& joint : description.joints) {
    poses.at(static_cast<size_t>(joint.child)) =
        Attach(poses.at(static_cast<size_t>(joint.parent)), joint, q.data() + next);
    next += joint.num_positions();
  }
  return poses;
}

Kinematics::Kinematics(const RobotDescription& robot)
    : joints_(robot.joints),
      num_positions_(robot.num_positions()),
      num_velocities_(robot.num_velocities()),
      links_(robot.links.size()) {
  for (int i = 0; i < robot.num_joints(); ++i) velocity_index_.push_back(robot.velocity_of(i));
}

void Kinematics::Update(const Vector& q, const Vector& v) {
  if (q.size() != num_positions_ || v.size() != num_velocities_) {
    throw std::invalid_argument("the robot has " + std::to_string(num_positions_) +
                                " coordinates and " + std::to_string(num_velocities_) +
                                " velocities, not " + std::to_string(q.size()) + " and " +
                                std::to_string(v.size()));
  }
  Eigen::Index next_q = 0, next_v = 0;
  for (const JointDescription& joint : joints_) {
    const LinkMotion& parent = links_[static_cast<size_t>(joint.parent)];
    LinkMotion& child = links_[static_cast<size_t>(joint.child)];
    static_cast<Pose&>(child) = Attach(parent, joint, q.data() + next_q);
    child.rate = parent.rate;
    child.velocity = parent.velocity + parent.rate.cross(child.position - parent.position);
    if (joint.type == Type::kSpherical) {
      child.rate += child.rotation * v.segment<3>(next_v);
    } else if (joint.type == Type::kPrismatic) {
      child.velocity += child.rotation * joint.axis * v[next_v];
    } else {
      child.rate += child.rotation * joint.axis * v[next_v];
    }
    next_q += joint.num_positions();
    next_v += joint.num_velocities();
  }
}

Eigen::Vector3d Kinematics::Position(int link, const Eigen::Vector3d& point) const {
  const LinkMotion& at = this->link(link);
  return at.position + at.rotation * point;
}

Eigen::Vector3d Kinematics::Velocity(int link, const Eigen::Vector3d& point) const {
  const LinkMotion& at = this->link(link);
  return at.velocity + at.rate.cross(at.rotation * point);
}

void Kinematics::Jacobian(int link, const Eigen::Vector3d& point,
                          Eigen::Ref<Eigen::Matrix3Xd> jacobian) const {
  jacobian.setZero();
  const Eigen::Vector3d position = Position(link, point);
  while (link > 0) {
    const auto index = static_cast<size_t>(link - 1);  // joint i moves link i + 1
    const JointDescription& joint = joints_[index];
    const LinkMotion& moved = links_[static_cast<size_t>(link)];
    const Eigen::Index at = velocity_index_[index];
    const Eigen::Vector3d arm = position - moved.position;
    if (joint.type == Type::kSpherical) {
      for (Eigen::Index k = 0; k < 3; ++k) jacobian.col(at + k) = moved.rotation.col(k).cross(arm);
    } else {
      const Eigen::Vector3d axis = moved.rotation * joint.axis;
      jacobian.col(at) = joint.type == Type::kPrismatic ? axis : Eigen::Vector3d(axis.cross(arm));
    }
    link = joint.parent;
  }
}

}  // namespace plumb
