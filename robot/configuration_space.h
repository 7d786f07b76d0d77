#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "robot/description.h"

namespace plumb {

/// What q of a robot is, besides a list of numbers: the quaternion of a spherical joint is a
/// rotation. How far q is from another and small steps from it have num_velocities entries, in the
/// units of v times seconds: of a spherical joint a rotation vector [rad] in the link's axes, as
/// its v has them (J. Sola, J. Deray, D. Atchuthan, "A micro Lie theory for state estimation in
/// robotics", arXiv:1812.01537, the right plus and minus of S^3); of all others a difference of
/// numbers. Standard deviations of q are of such differences. Thread-safe.
class ConfigurationSpace {
 public:
  using Vector = Eigen::Ref<const Eigen::VectorXd>;
  static constexpr double kUnit = 1e-6;  ///< by which a unit quaternion's length may be off

  explicit ConfigurationSpace(const RobotDescription& robot);

  Eigen::Index num_positions() const { return num_positions_; }
  Eigen::Index num_velocities() const { return num_velocities_; }
  /// Every joint has one coordinate: a difference is one of numbers.
  bool flat() const { return turns_.empty(); }

  /// From b to a, the short way round; NaN where either is. @param a, b num_positions entries.
  Eigen::VectorXd Difference(const Vector& a, const Vector& b) const;
  /// Entry c of it, 0 <= c < num_velocities.
  double Difference(const Vector& a, const Vector& b, Eigen::Index c) const;
  /// num_velocities numbers for q: those of all joints that have one, and rotation vectors from
  /// `about`. Near there, differences of such numbers are Difference's.
  Eigen::VectorXd Coordinates(const Vector& q, const Vector& about) const;
  /// The q of such numbers.
  Eigen::VectorXd At(const Vector& coordinates, const Vector& about) const;
  /// Where one is after a step from q: Difference(Move(q, step), q) = step, if that turns no joint
  /// by more than pi. Quaternions are of unit length again.
  Eigen::VectorXd Move(const Vector& q, const Vector& step) const;
  /// The same in place. Does not allocate.
  void MoveInPlace(const Vector& step, Eigen::Ref<Eigen::VectorXd> q) const;
  /// The same for a step of `by` in entry c alone.
  void Move(Eigen::Index c, double by, Eigen::Ref<Eigen::VectorXd> q) const;
  /// Makes quaternions, which may have been written with few digits, unit ones, and of the two of a
  /// rotation the one that is nearer to `like`'s. Those with a NaN stay as they are.
  /// @return what is wrong, as Fault, where a length is not 1 within kRounded: q is undefined then.
  std::string Normalise(const Vector& like, Eigen::Ref<Eigen::VectorXd> q) const;
  static constexpr double kRounded = 1e-3;

  /// Whether q has num_positions entries, all finite, quaternions of unit length but for kUnit.
  /// Does not allocate.
  bool Has(const Vector& q) const;
  /// Why not: "of base/rotation (0, 0, 0, 0) is no unit quaternion"; empty if it is.
  std::string Fault(const Vector& q) const;

 private:
  struct Turn {
    std::string joint;
    Eigen::Index position, velocity;  // of its first entries
  };
  static bool IsUnit(const Vector& q, const Turn& turn);
  static std::string Fault(const std::string& joint, const Eigen::Vector4d& quaternion);

  std::vector<Turn> turns_;
  std::vector<Eigen::Index> position_of_;  // of each velocity; -1: a spherical joint's
  Eigen::Index num_positions_, num_velocities_;
};

}  // namespace plumb
