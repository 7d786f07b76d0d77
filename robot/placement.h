#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "robot/configuration_space.h"
#include "robot/description.h"
#include "robot/floating_base.h"

namespace plumb {

/// How far a robot is from where it was to be put. Of a base in space that the legs and an IMU tell
/// of ([estimator] base = "legs"), nobody knows where along the ground it is nor which way it
/// heads, and no dynamics depend on that: there height and lean count. Thread-safe.
class Placement {
 public:
  using Vector = ConfigurationSpace::Vector;

  /// @throws std::invalid_argument, see FloatingBaseOf, if base = "legs".
  explicit Placement(const RobotDescription& robot);

  /// num_velocities entries, as ConfigurationSpace::Difference; 0 of what nobody knows.
  /// @param q, wanted num_positions entries.
  Eigen::VectorXd Distance(const Vector& q, const Vector& wanted) const;
  /// An entry is one of q's.
  bool flat() const { return space_.flat(); }
  /// Of such an entry: "base/z", "base/rotation/x".
  const std::string& name(Eigen::Index entry) const { return names_[static_cast<size_t>(entry)]; }

 private:
  ConfigurationSpace space_;
  std::vector<std::string> names_;
  // Of a base in space: entries along the ground, the rotation's first entries, up in its joint.
  std::vector<Eigen::Index> unknown_;
  Eigen::Index rotation_ = -1, quaternion_ = -1;
  Eigen::Vector3d up_ = Eigen::Vector3d::UnitZ();
};

}  // namespace plumb
