#include "sim/touch.h"

#include <algorithm>

namespace plumb {

TouchFinder::TouchFinder(const RobotDescription& robot, double margin)
    : margin_(margin),
      kinematics_(robot),
      points_(ContactPoints(robot)),
      still_(Eigen::VectorXd::Zero(robot.num_velocities())) {
  Eigen::Index position = 0;
  for (const JointDescription& joint : robot.joints) {
    if (robot.simulation.stop && joint.type != JointDescription::Type::kSpherical)
      stops_.push_back({position, joint.lower, joint.upper});
    position += joint.num_positions();
  }
}

Touch TouchFinder::Find(const Eigen::Ref<const Eigen::VectorXd>& q) {
  kinematics_.Update(q, still_);
  const bool ground = std::any_of(points_.begin(), points_.end(), [&](const ContactPoint& point) {
    return kinematics_.Position(point.link, point.centre).z() <= point.radius + margin_;
  });
  const bool stop = std::any_of(stops_.begin(), stops_.end(), [&](const Stop& joint) {
    return q[joint.position] <= joint.lower + margin_ || q[joint.position] >= joint.upper - margin_;
  });
  return {ground, stop};
}

}  // namespace plumb
