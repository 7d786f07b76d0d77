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
  return Touching(q);
}

// Of what the kinematics were updated with.
Touch TouchFinder::Touching(const Eigen::Ref<const Eigen::VectorXd>& q) const {
  const bool ground = std::any_of(points_.begin(), points_.end(), [&](const ContactPoint& point) {
    return kinematics_.Position(point.link, point.centre).z() <= point.radius + margin_;
  });
  const bool stop = std::any_of(stops_.begin(), stops_.end(), [&](const Stop& joint) {
    return q[joint.position] <= joint.lower + margin_ || q[joint.position] >= joint.upper - margin_;
  });
  return {ground, stop};
}

int TouchFinder::num_nearness() const {
  return static_cast<int>(4 * points_.size() + stops_.size());
}

Touch TouchFinder::Nearness(const Eigen::Ref<const Eigen::VectorXd>& q,
                            const Eigen::Ref<const Eigen::VectorXd>& v,
                            Eigen::Ref<Eigen::VectorXd> nearness) {
  const auto distance = [&](double metres) {
    return std::clamp(metres / margin_, -kReach, kReach);
  };
  kinematics_.Update(q, v);
  Eigen::Index i = 0;
  for (const ContactPoint& point : points_) {
    const double height =
        distance(kinematics_.Position(point.link, point.centre).z() - point.radius);
    nearness[i] = height;
    nearness.segment<3>(i + 1) =
        std::clamp(kReach - height, 0.0, 1.0) * kinematics_.Velocity(point.link, point.centre);
    i += 4;
  }
  for (const Stop& joint : stops_) {
    nearness[i++] =
        distance(q[joint.position] - joint.lower) - distance(joint.upper - q[joint.position]);
  }
  return Touching(q);
}

}  // namespace plumb
