#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace plumb {

/// A solid of URDF's <visual> or <collision>. Plain data, as all of this file: not thread-safe.
struct Shape {
  enum class Type { kSphere, kCapsule, kCylinder, kBox, kMesh };
  Type type = Type::kSphere;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();      ///< [m] of its centre, in the link frame
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< its axes in the link's
  /// [m] sphere: (radius, 0, 0); box: edges along x, y, z; capsule and cylinder, which stand along
  /// z: (radius, length, 0), a capsule's length without its caps.
  Eigen::Vector3d size = Eigen::Vector3d::Zero();
  /// [m] of a mesh: of its convex hull, in its own axes, from its position
  std::vector<Eigen::Vector3d> corners = {};
};

/// A link of the URDF that a fixed joint makes a part of another.
struct FixedLink {
  std::string link, joint;  ///< their names
};

/// A rigid body. Frames as in URDF: the link frame is at the joint that moves it. What hangs on it
/// by fixed joints belongs to it. A link may have no mass if links beyond it have.
struct LinkDescription {
  std::string name;
  double mass = 0;                                           ///< [kg]
  Eigen::Vector3d center_of_mass = Eigen::Vector3d::Zero();  ///< [m], in the link frame
  /// [kg m^2], about the centre of mass, link axes
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  std::vector<Shape> visuals = {}, collisions = {};
  std::vector<FixedLink> fixed = {};  ///< what hangs on it by fixed joints
};

/// A moving joint, connecting links[parent] to links[child]. URDF's planar and floating joints are
/// several of these:
///   planar    <name>/x, <name>/y prismatic in the plane, <name>/angle continuous about its normal
///   floating  <name>/x, <name>/y, <name>/z prismatic, <name>/rotation spherical
/// with links without mass in between, named after their joints.
struct JointGeometry {
  /// kSpherical: q is a unit quaternion (w, x, y, z) that turns link axes into joint axes, v the
  /// angular velocity in link axes [rad/s], as MuJoCo's ball and free joints have them.
  enum class Type { kRevolute, kContinuous, kPrismatic, kSpherical };
  std::string name;
  Type type = Type::kRevolute;
  int parent = 0;  ///< index into links
  int child = 0;   ///< index into links
  /// [m], in the parent link's frame
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  /// joint frame's axes in the parent link's
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  /// unit vector, in the joint frame
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();
  double lower = 0;           ///< [rad] or [m]; -infinity for a continuous joint
  double upper = 0;           ///< [rad] or [m]; +infinity for a continuous joint
  double effort_limit = 0;    ///< [Nm] or [N], > 0; 0 for a passive joint
  double velocity_limit = 0;  ///< [rad/s] or [m/s], > 0; infinity where the URDF gives none

  int num_positions() const { return type == Type::kSpherical ? 4 : 1; }
  int num_velocities() const { return type == Type::kSpherical ? 3 : 1; }
};

}  // namespace plumb
