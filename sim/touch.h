#pragma once

#include <Eigen/Core>
#include <vector>

#include "robot/contact_points.h"
#include "robot/description.h"
#include "robot/kinematics.h"

namespace plumb {

/// The ground and the stops that a robot touches in a state.
struct Touch {
  bool ground = false;  ///< a contact point of a collision shape is at or below z = 0 of the base
  bool stop = false;    ///< a joint is at or beyond a position limit
  bool any() const { return ground || stop; }
};

/// Finds what a robot touches. Only what its simulator knows counts: the ground with
/// SimulationSettings::contact, stops with SimulationSettings::stop. Not thread-safe; does not
/// allocate after construction.
class TouchFinder {
 public:
  /// @param robot with known parameters (Model::Describe), as lengths decide how far down it
  /// reaches. @param margin [m], [rad] >= 0: as near as this counts as touching.
  explicit TouchFinder(const RobotDescription& robot, double margin = 0);

  /// @param q as in RobotDescription. @throws std::invalid_argument if q has the wrong size.
  Touch Find(const Eigen::Ref<const Eigen::VectorXd>& q);

 private:
  struct Stop {
    Eigen::Index position;
    double lower, upper;
  };

  double margin_;
  Kinematics kinematics_;
  std::vector<ContactPoint> points_;
  std::vector<Stop> stops_;
  Eigen::VectorXd still_;  // velocities, all zero
};

}  // namespace plumb
