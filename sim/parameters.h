#pragma once

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

#include "common/random.h"
#include "robot/description.h"
#include "sim/dynamics/physics.h"
#include "sim/dynamics/topology.h"
#include "sim/parameter_paths.h"

namespace plumb {

/// Turns a description's uncertain and frozen parameters into a robot's physics. The paths:
///   gravity                 [m/s^2] >= 0
///   mass/<link>             [kg] > 0: scales mass and inertia; the shape stays. The base's has no
///                           effect.
///   com/<link>/{x,y,z}      [m] centre of mass in the link frame
///   inertia/<link>          > 0: scales the inertia about the centre of mass; 1 = as the URDF has
///                           it
///   inertia/<link>/{xx,yy,zz,xy,xz,yz}
///                           log-Cholesky coordinates of it, 0 = as the URDF has it: see below
///   length/<link>           [m] > 0: stretches the link with all that is on it, its further joints
///                           too, at equal mass: positions times l/l0, inertia about the centre of
///                           mass times (l/l0)^2. l0 is the distance to the first further joint,
///                           or, of a link that carries none, the length that the URDF implies for
///                           a uniform rod: twice that of the centre of mass.
///   <kind>/<joint>          those of kJointParameterKinds, as in JointDynamics; of a
///                           spherical joint they are for all of its axes
///   contact/<kind>, limit/<kind>
///                           those of kWorldParameterKinds, as in SimulationSettings
///
/// A name with a wildcard is one number for all paths of a kind that it covers
/// (robot/parameters.h), but for those that another parameter names in full: legs are built alike,
/// and mass/*_thigh is learnt from all of them.
///
/// Only inertias that a body can have can be expressed. With S = tr(I)/2 - I, the second moment of
/// mass about the centre (I is physical exactly where S is positive semidefinite: Wensing, Kim,
/// Slotine, RA-L 3, 2018), and L L^T that of the URDF's inertia in link axes,
///   S = L C C^T L^T,
/// with C lower triangular, exp(xx), exp(yy), exp(zz) on its diagonal and xy, xz, yz below it:
/// log-Cholesky coordinates (Rucker, Wensing, RA-L 7, 2022) of the deviation from the URDF.
///
/// Values set absolutely come first, then what scales, so the order of the parameters does not
/// matter. Immutable, hence thread-safe.
class Parameters {
 public:
  /// @throws std::invalid_argument for a path that is none of the above, naming the nearest that
  /// is, one that two parameters give, or a value that is not physical.
  Parameters(const RobotDescription& description, const Topology& topology);

  int size() const { return static_cast<int>(means_.size()); }
  /// Prior means, physical units.
  const Eigen::VectorXd& means() const { return means_; }
  /// The robot with its frozen parameters and the prior means of the uncertain ones.
  Physics<double> Nominal() const;
  /// The terms of the equations that some values of the parameters need.
  const Terms& terms() const { return terms_; }
  bool delays() const { return terms_.Has(&JointDynamics::delay); }
  bool sensor_errors() const {
    return terms_.Has(&JointDynamics::sensor_delay) || terms_.Has(&JointDynamics::sensor_bias);
  }

  /// Writes the physics with these parameters. Does not allocate.
  /// @param physical in the order of description.parameters, physical units.
  /// @param physics one that Nominal returned, whatever was written to it since.
  /// @throws std::invalid_argument if a value is not finite or not physical, or the size is wrong;
  /// `physics` is then unchanged.
  void Apply(const Eigen::Ref<const Eigen::VectorXd>& physical, Physics<double>* physics) const;

 private:
  struct Uncertain {
    ParameterPath path;
    int parameter;  // index
  };
  struct Fixed {
    ParameterPath path;
    double value;
  };
  // Cholesky coordinates of a link's inertia: where they come from.
  struct Inertia {
    size_t link;
    std::array<int, 6> parameter;  // index of the uncertain parameter, or -1: the value holds
    std::array<double, 6> value;
  };

  void FindPathsOf(const RobotDescription& description);
  static void Check(const std::string& path, Range values, double value);
  void Freeze(const ParameterPath& path, double value);
  void AddCholesky(const ParameterPath& path, int parameter, double value);
  void FindTerms(const RobotDescription& description);
  void Set(const ParameterPath& path, double value, Physics<double>* physics) const;
  void Scale(const ParameterPath& path, double value, Physics<double>* physics) const;
  void SetInertia(const Inertia& inertia, const Eigen::Ref<const Eigen::VectorXd>& physical,
                  Physics<double>* physics) const;

  std::vector<int> parents_;                // link that carries each joint
  std::vector<int> point_links_;            // link of each contact point
  std::vector<int> solid_links_;            // and of each shape that touches others
  std::vector<Eigen::Matrix3d> link_axes_;  // of the link of each joint, in working axes
  std::vector<Eigen::Vector3d> centers_;    // of mass, in the link frame
  std::vector<Eigen::Matrix3d> roots_;      // L of each link, in working axes
  Physics<double> base_;                    // the files, and what is frozen and not a factor
  std::vector<Uncertain> uncertain_;
  std::vector<Fixed> factors_;  // frozen
  std::vector<Inertia> inertias_;
  Eigen::VectorXd means_;
  Terms terms_;
};

/// The truth behind a virtual robot: the prior means, with description.virtual_robot.hidden drawn
/// uniformly from their ranges. Equal seeds give equal robots, in any process.
/// @return physical units, order of description.parameters.
/// @throws std::invalid_argument if a hidden parameter is not one of the parameters.
Eigen::VectorXd HiddenParameters(const RobotDescription& description, uint64_t seed);

}  // namespace plumb
