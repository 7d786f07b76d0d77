#pragma once

#include <Eigen/Core>
#include <vector>

#include "robot/contact_pairs.h"
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

  /// A shape that may touch those of other links.
  struct Solid {
    int link;        ///< as in Joint::parent
    double axes[9];  ///< of its box in working axes at q = 0, columns first: constant in the link
  };
  struct Pair {
    size_t first, second;  ///< solids that may touch, of the lower link first
    size_t spots;          ///< where they do so at once, at most
    /// Neither link carries the other: their contact couples velocities of two branches.
    bool couples;
  };

  std::vector<Joint> joints;
  std::vector<Point> points;
  std::vector<Solid> solids;
  std::vector<Pair> pairs;
  /// For each velocity the one of the nearest joint axis on the way to the base, -1 at its end:
  /// where the mass matrix may differ from zero (Featherstone, "Rigid Body Dynamics Algorithms",
  /// 2008, section 6.3).
  std::vector<int> ancestors;
  /// The same of the matrix with contacts, where those of two branches couple their velocities
  /// (the elimination tree: Liu, "The role of elimination trees in sparse factorization", 1990).
  std::vector<int> pattern;
  int positions = 0, velocities = 0;
  /// All joints move in one plane, if there are points an upright one, and there are no pairs.
  bool planar = false;
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

  /// The last of the velocities that move a link; -1 for the base.
  int LastVelocity(int link) const {
    if (link == 0) return -1;
    const Joint& joint = joints[static_cast<size_t>(link - 1)];
    return joint.velocity + (joint.type == JointDescription::Type::kSpherical ? 2 : 0);
  }

  /// @throws std::invalid_argument as RequireTree.
  explicit Topology(const RobotDescription& description);

 private:
  void AddJoint(const JointDescription& described);
  void AddPairs(const RobotDescription& robot, const ContactPairs& touching);
  void FindPattern();
  void FindAnchor();
};

}  // namespace plumb
