#include "sim/touch.h"

#include <algorithm>
#include <cmath>

#include "common/special_numbers.h"

namespace plumb {

TouchFinder::TouchFinder(const RobotDescription& robot, double margin)
    : margin_(margin),
      kinematics_(robot),
      points_(ContactPoints(robot)),
      still_(Eigen::VectorXd::Zero(robot.num_velocities())) {
  for (int i = 0; i < robot.num_joints(); ++i) {
    const JointDescription& joint = robot.joints[static_cast<size_t>(i)];
    if (robot.simulation.stop && joint.type != JointDescription::Type::kSpherical)
      stops_.push_back({robot.position_of(i), joint.lower, joint.upper});
  }
  ContactPairs touching = FindContactPairs(robot);
  for (const ContactPairs::Solid& at : touching.solids) {
    const Shape& shape = robot.links[static_cast<size_t>(at.link)].collisions[at.shape];
    solids_.push_back({at.link, shape, RoundedBox(shape)});
  }
  pairs_ = std::move(touching.pairs);
}

Touch TouchFinder::Find(const Eigen::Ref<const Eigen::VectorXd>& q) {
  kinematics_.Update(q, still_);
  const bool ground = std::any_of(points_.begin(), points_.end(), [&](const ContactPoint& point) {
    return kinematics_.Position(point.link, point.centre).z() <= point.radius + margin_;
  });
  const bool stop = std::any_of(stops_.begin(), stops_.end(), [&](const Stop& joint) {
    return q[joint.position] <= joint.lower + margin_ || q[joint.position] >= joint.upper - margin_;
  });
  return {ground, stop, LinksTouch()};
}

Touch TouchFinder::OfStep(const Eigen::Ref<const Eigen::VectorXd>& q,
                          const Eigen::Ref<const Eigen::VectorXd>& next_q) {
  const Touch begin = Find(q);
  return next_q.allFinite() ? begin | Find(next_q) : begin;
}

bool TouchFinder::LinksTouch() {
  return std::any_of(pairs_.begin(), pairs_.end(), [this](const auto& pair) {
    NearSpots spots;
    // A spot at the margin counts, too.
    const double margin = std::nextafter(margin_, kInfinity);
    return FindNearSpots(Place(solids_[pair.first]), Place(solids_[pair.second]), margin, &spots);
  });
}

PlacedSolid TouchFinder::Place(const Solid& solid) const {
  const Eigen::Vector3d centre = kinematics_.Position(solid.link, solid.shape.position);
  const Eigen::Matrix3d axes = kinematics_.link(solid.link).rotation * solid.shape.rotation;
  PlacedSolid placed;
  placed.centre = Vector<double>::From(centre.data());
  for (Eigen::Index k = 0; k < 3; ++k) {
    placed.axes[static_cast<size_t>(k)] = Vector<double>::From(axes.col(k).data());
    placed.half[static_cast<size_t>(k)] = solid.box.half[k];
  }
  placed.radius = solid.box.radius;
  return placed;
}

}  // namespace plumb
