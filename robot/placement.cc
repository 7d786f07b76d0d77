#include "robot/placement.h"

#include <Eigen/Geometry>
#include <cmath>

namespace plumb {
namespace {

constexpr double kLevel = 1e-9;  // of a direction's rise

Eigen::Quaterniond UnitQuaternionAt(const Placement::Vector& q, Eigen::Index i) {
  return Eigen::Quaterniond(q[i], q[i + 1], q[i + 2], q[i + 3]).normalized();
}

}  // namespace

Placement::Placement(const RobotDescription& robot) : space_(robot) {
  std::optional<FloatingBase> base;
  if (robot.estimator.base == EstimatorSettings::Base::kLegs) base = FloatingBaseOf(robot);
  for (int i = 0; i < robot.num_joints(); ++i) {
    const JointDescription& joint = robot.joints[static_cast<size_t>(i)];
    const auto v = static_cast<Eigen::Index>(names_.size());
    if (base && base->spatial) {
      for (const ImuMounting::Slide& slide : base->slides) {
        if (slide.joint == i && std::abs(slide.direction.z()) < kLevel) unknown_.push_back(v);
      }
      if (base->turned == i) rotation_ = v, quaternion_ = robot.position_of(i);
    }
    if (joint.num_velocities() == 1) {
      names_.push_back(joint.name);
    } else {
      for (const char* axis : {"/x", "/y", "/z"}) names_.push_back(joint.name + axis);
    }
  }
  if (rotation_ >= 0) up_ = base->zero.rotation.transpose() * Eigen::Vector3d::UnitZ();
}

Eigen::VectorXd Placement::Distance(const Vector& q, const Vector& wanted) const {
  Eigen::VectorXd distance = space_.Difference(q, wanted);
  for (const Eigen::Index entry : unknown_) distance[entry] = 0;
  if (rotation_ < 0) return distance;
  // The turn that takes up, as the link is to have it, to where it has it.
  const Eigen::Vector3d has = UnitQuaternionAt(q, quaternion_).conjugate() * up_,
                        wants = UnitQuaternionAt(wanted, quaternion_).conjugate() * up_;
  const Eigen::AngleAxisd lean(Eigen::Quaterniond::FromTwoVectors(has, wants));
  distance.segment<3>(rotation_) = lean.angle() * lean.axis();
  return distance;
}

}  // namespace plumb
