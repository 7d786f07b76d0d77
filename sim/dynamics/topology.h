#pragma once

#include <Eigen/Core>
#include <vector>

#include "robot/description.h"

namespace plumb {

/// How a robot hangs together: what no parameter changes. Immutable, hence thread-safe.
///
/// Vectors are in working axes. Where q = 0 they are the axes of every link, so that a joint turns
/// its link about the same vector whether seen from the parent or the child, and no fixed rotation
/// is left in the recursion. In the world they are its axes, or, if the robot moves in a plane
/// (Planar()), x and y in that plane with y as upright as can be, and z its normal.
struct Topology {
  struct Joint {
    JointDescription::Type type;
    int parent;      ///< link that carries it: 0 is the base, i + 1 the link that joint i moves
    int position;    ///< its first index in q
    int velocity;    ///< and in v
    double axis[3];  ///< unit vector; unused by spherical joints
    /// Link axes in working axes at q = 0, columns first: only spherical joints care, whose v is in
    /// link axes.
    double link_axes[9];
    double lower, upper, effort_limit;  ///< infinite where there is none
    bool turns() const { return type != JointDescription::Type::kPrismatic; }
  };
  struct Point {
    int link;  ///< as in Joint::parent
  };

  std::vector<Joint> joints;
  std::vector<Point> points;
  /// For each velocity the one of the nearest joint axis on the way to the base, -1 at its end:
  /// where the mass matrix may differ from zero (Featherstone, "Rigid Body Dynamics Algorithms",
  /// 2008, section 6.3).
  std::vector<int> ancestors;
  int positions = 0, velocities = 0;
  bool planar = false;    ///< all joints move in one plane; if there are points, an upright one
  bool coriolis = false;  ///< accelerations depend on velocities
  /// Link whose origin sums of moments refer to: the one that carries the robot through space, else
  /// the base. Far from the world's origin nothing is lost to cancellation.
  int anchor = 0;
  double up[3] = {0, 0, 1};                                  ///< against gravity, working axes
  Eigen::Matrix3d world_axes = Eigen::Matrix3d::Identity();  ///< the world's axes in working axes
  /// each link's (from the base on) in working axes, at q = 0
  std::vector<Eigen::Matrix3d> link_axes;

  /// In which a contact point can be pushed: upwards, and along the ground.
  int contact_directions() const { return planar ? 2 : 3; }

  /// @throws std::invalid_argument unless joint i moves link i + 1 and hangs on a link before it.
  explicit Topology(const RobotDescription& description);
};

}  // namespace plumb
