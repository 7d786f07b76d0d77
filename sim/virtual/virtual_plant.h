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
///   others  another contact, other stops, another integrator than any model has: those of the
///           program that it names, see the header of its backend
/// Coulomb friction and backlash of description.virtual_robot.joints, its ground and its sprung
/// masses come on top. q and v are the robot's without those masses. Not thread-safe.
class VirtualPlant {
 public:
  using Vector = PhysicsBackend::Vector;

  /// @param robot with known parameters, see Model::Describe.
  /// @throws std::invalid_argument if it cannot be simulated.
  explicit VirtualPlant(const RobotDescription& robot);

  /// Sprung masses rest in their links, in the middle of their travel.
  /// @throws std::invalid_argument if an entry is not finite or the size is wrong.
  void SetState(const Vector& q, const Vector& v);
  /// Holds the motors' efforts for `duration` [s] >= 0. A state that would not be finite is not
  /// taken on.
  /// @return false then.
  bool Advance(const Vector& effort, double duration);

  const Eigen::VectorXd& q() const { return q_; }
  const Eigen::VectorXd& v() const { return v_; }
  /// The same as the motors have it, before the backlash of their gears.
  const Eigen::VectorXd& motor_q() const { return motor_q_; }
  const Eigen::VectorXd& motor_v() const { return motor_v_; }

 private:
  VirtualPlant(const RobotDescription& robot, const RobotDescription& real);
  void Show();

  std::unique_ptr<PhysicsBackend> backend_;
  GearPlay play_;
  Eigen::VectorXd q_, v_, motor_q_, motor_v_;
  Eigen::VectorXd all_q_, all_v_, all_effort_;  // of the backend, which has the sprung masses, too
};

}  // namespace plumb
