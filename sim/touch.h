#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "robot/contact_pairs.h"
#include "robot/contact_points.h"
#include "robot/description.h"
#include "robot/kinematics.h"
#include "sim/dynamics/narrow_phase.h"

namespace plumb {

/// What a robot touches in a state.
struct Touch {
  bool ground = false;  ///< a contact point of a collision shape is at or below z = 0 of the base
  bool stop = false;    ///< a joint is at or beyond a position limit
  bool links = false;   ///< two shapes that can (ContactPairs) touch each other
  bool any() const { return ground || stop || links; }
  friend Touch operator|(const Touch& a, const Touch& b) {
    return {a.ground || b.ground, a.stop || b.stop, a.links || b.links};
  }
};

/// Finds what a robot touches. Only what its simulator knows counts: the ground with
/// SimulationSettings::contact, other links with its pairs, stops with SimulationSettings::stop.
/// Not thread-safe; does not allocate after construction.
class TouchFinder {
 public:
  /// @param robot with known parameters (Model::Describe), as lengths decide how far down it
  /// reaches. @param margin [m], [rad] >= 0: as near as this counts as touching.
  explicit TouchFinder(const RobotDescription& robot, double margin = 0);

  /// @param q as in RobotDescription. @throws std::invalid_argument if q has the wrong size.
  Touch Find(const Eigen::Ref<const Eigen::VectorXd>& q);
  /// Of a step: at its beginning or its end. @param next_q that is not finite was not observed: the
  /// beginning has to do.
  Touch OfStep(const Eigen::Ref<const Eigen::VectorXd>& q,
               const Eigen::Ref<const Eigen::VectorXd>& next_q);

 private:
  struct Stop {
    Eigen::Index position;
    double lower, upper;
  };

  /// A shape that touches others, and the link that it is on.
  struct Solid {
    int link;
    Shape shape;
    RoundedBox box;
  };
  bool LinksTouch();
  PlacedSolid Place(const Solid& solid) const;

  double margin_;
  Kinematics kinematics_;
  std::vector<ContactPoint> points_;
  std::vector<Solid> solids_;
  std::vector<std::pair<size_t, size_t>> pairs_;
  std::vector<Stop> stops_;
  Eigen::VectorXd still_;  // velocities, all zero
};

}  // namespace plumb
