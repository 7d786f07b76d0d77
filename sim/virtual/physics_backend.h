#pragma once

#include <Eigen/Core>

namespace plumb {

/// The physics of a virtual robot: integrates the motion of its joints under the efforts of its
/// motors. Not thread-safe.
class PhysicsBackend {
 public:
  using Vector = Eigen::Ref<const Eigen::VectorXd>;

  virtual ~PhysicsBackend() = default;

  /// @throws std::invalid_argument if an entry is not finite or the size is wrong; the state is
  /// then unchanged.
  virtual void SetState(const Vector& q, const Vector& v) = 0;
  /// Holds `effort` [Nm or N] for `duration` [s] >= 0. A state that would not be finite is not
  /// taken on: the robot then stays where it was. @return false in that case.
  virtual bool Advance(const Vector& effort, double duration) = 0;

  virtual const Eigen::VectorXd& q() const = 0;  ///< [rad or m]
  virtual const Eigen::VectorXd& v() const = 0;  ///< [rad/s or m/s]
};

}  // namespace plumb
