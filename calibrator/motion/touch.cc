#include "calibrator/motion/touch.h"

#include <stdexcept>
#include <vector>

#include "robot/contact_points.h"
#include "robot/kinematics.h"

namespace plumb {
namespace {

bool TouchesGround(const RobotDescription& robot, const Eigen::Ref<const Eigen::VectorXd>& q) {
  const std::vector<Pose> poses = LinkPoses(robot, q);
  for (const ContactPoint& point : ContactPoints(robot)) {
    const Pose& link = poses[static_cast<size_t>(point.link)];
    if ((link.position + link.rotation * point.centre).z() <= point.radius) return true;
  }
  return false;
}

bool TouchesStop(const RobotDescription& robot, const Eigen::Ref<const Eigen::VectorXd>& q) {
  Eigen::Index position = 0;
  for (const JointDescription& joint : robot.joints) {
    const double angle = q[position];
    position += joint.num_positions();
    if (joint.type == JointDescription::Type::kSpherical) continue;
    if (angle <= joint.lower || angle >= joint.upper) return true;
  }
  return false;
}

}  // namespace

Touch FindTouch(const RobotDescription& robot, const Eigen::Ref<const Eigen::VectorXd>& q) {
  if (q.size() != robot.num_positions())
    throw std::invalid_argument("the state is not one of " + robot.name);
  return {TouchesGround(robot, q), robot.simulation.stop && TouchesStop(robot, q)};
}

Touch FindTouch(const RobotDescription& robot, const Transition& transition) {
  const Touch begin = FindTouch(robot, transition.q);
  if (!transition.next_q.allFinite()) return begin;
  const Touch end = FindTouch(robot, transition.next_q);
  return {begin.ground || end.ground, begin.stop || end.stop};
}

}  // namespace plumb
