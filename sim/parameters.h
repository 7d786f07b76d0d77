#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/random.h"
#include "robot/description.h"

namespace plumb {

/// What the equations of motion know of a robot apart from its joints.
struct InertialModel {
  struct Body {
    double mass;                     ///< [kg]
    Eigen::Vector3d center_of_mass;  ///< [m], in the link frame
    Eigen::Matrix3d inertia;         ///< [kg m^2], about the centre of mass, link axes
  };
  double gravity;            ///< [m/s^2], along -z of the base
  std::vector<Body> bodies;  ///< one per joint: the link that the joint moves
};

/// Gravity where it is not a parameter: the standard acceleration of free fall, ISO 80000-3 [m/s^2].
inline constexpr double kStandardGravity = 9.80665;

/// Turns the description's uncertain parameters into inertias. The paths:
///   "gravity"        [m/s^2], >= 0
///   "mass/<link>"    [kg], > 0: scales mass and inertia; the shape stays
///   "length/<link>"  [m], > 0: stretches the link along with its centre of mass at equal mass: centre of
///   mass
///                    times l/l0, inertia about it times (l/l0)^2. l0 is the length that the URDF implies for
///                    a uniform rod hung at one end, twice the distance of the centre of mass from the joint.
///                    Only for links that carry no further joint.
/// The factors multiply, so the order of the parameters does not matter. Immutable, hence thread-safe.
class Parameters {
 public:
  /// @throws std::invalid_argument for a path that is not one of the above; names the nearest that is.
  explicit Parameters(const RobotDescription& description);

  int size() const { return static_cast<int>(bindings_.size()); }
  /// The robot as its URDF has it, with the prior means for its parameters.
  InertialModel Nominal() const;
  /// Prior means, physical units.
  const Eigen::VectorXd& means() const { return means_; }

  /// Writes the model with these parameters. Well below 1 us; does not allocate.
  /// @param physical in the order of description.parameters, physical units.
  /// @param model one that Nominal returned.
  /// @throws std::invalid_argument if a value is not finite or not physical, or the size is wrong; the model
  /// is then unchanged.
  void Apply(const Eigen::Ref<const Eigen::VectorXd>& physical, InertialModel& model) const;

 private:
  enum class Kind { kGravity, kMass, kLength };
  struct Binding {
    Kind kind;
    size_t body;       // index into InertialModel::bodies
    double reference;  // what the URDF implies
  };
  Binding Bind(const RobotDescription& description, const std::string& path) const;

  std::vector<std::string> names_;
  std::vector<Binding> bindings_;
  Eigen::VectorXd means_;
  InertialModel urdf_;
};

/// The truth behind a virtual robot: the prior means, with description.virtual_robot.hidden drawn uniformly
/// from their ranges. Equal seeds give equal robots, in any process.
/// @return physical units, order of description.parameters.
/// @throws std::invalid_argument if a hidden parameter is not one of the parameters.
Eigen::VectorXd HiddenParameters(const RobotDescription& description, uint64_t seed);

}  // namespace plumb
