#pragma once

#include <Eigen/Core>

#include "robot/description.h"

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

/// Thread-safe. @throws std::invalid_argument naming a joint that turns about all axes.
void RequireHingesAndSlides(const RobotDescription& robot);

/// What every engine of others can be told of a joint: armature, damping, friction, a spring and a
/// motor's gain. Thread-safe.
/// @throws std::invalid_argument naming the first thing else that one of the robot's joints has.
void RequireKnownJoints(const RobotDescription& robot);

/// Thread-safe. @throws std::invalid_argument if links are to touch each other, or what the base
/// carries.
void RequireNoLinkContact(const RobotDescription& robot);

/// Thread-safe. @throws std::invalid_argument unless q and v have so many entries, all finite.
void RequireState(const PhysicsBackend::Vector& q, const PhysicsBackend::Vector& v,
                  Eigen::Index positions, Eigen::Index velocities);

}  // namespace plumb
