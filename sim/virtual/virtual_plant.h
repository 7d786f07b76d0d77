#pragma once

#include <Eigen/Core>
#include <memory>

#include "robot/description.h"
#include "sim/virtual/gear_play.h"
#include "sim/virtual/physics_backend.h"

namespace plumb {

/// The moving parts of a virtual robot. By description.virtual_robot.engine:
///   auto    a SimbodyPlant, or, where the robot has something that a SimbodyPlant has not
///           (armature, stops, contact), a fine simulator (see MakeFineSimulator): then reality has
///           the simulator's equations, but not its integration errors: errors of a model of
///           contact do not show there
///   mujoco  MuJoCo (see MakeMujocoBackend): another contact, other stops, another integrator than
///           any model has
/// Coulomb friction and backlash of description.virtual_robot.joints come on top. Not thread-safe.
class VirtualPlant {
 public:
  using Vector = PhysicsBackend::Vector;

  /// @param robot with known parameters, see Model::Describe.
  /// @throws std::invalid_argument if it cannot be simulated.
  explicit VirtualPlant(RobotDescription robot);

  /// @throws std::invalid_argument if an entry is not finite or the size is wrong.
  void SetState(const Vector& q, const Vector& v);
  /// Holds the motors' efforts for `duration` [s] >= 0. A state that would not be finite is not
  /// taken on.
  /// @return false then.
  bool Advance(const Vector& effort, double duration);

  const Eigen::VectorXd& q() const { return backend_->q(); }
  const Eigen::VectorXd& v() const { return backend_->v(); }
  /// The same as the motors have it, before the backlash of their gears.
  const Eigen::VectorXd& motor_q() const { return play_.any() ? play_.q() : q(); }
  const Eigen::VectorXd& motor_v() const { return play_.any() ? play_.v() : v(); }

 private:
  std::unique_ptr<PhysicsBackend> backend_;
  GearPlay play_;
};

}  // namespace plumb
