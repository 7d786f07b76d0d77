#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>

#include "robot/description.h"

namespace plumb {

/// The physics of the virtual robot: what stands for reality. It shares neither equations nor integrator with
/// Simulator, so that the two agree only because both are right: Simbody the textbook way, with a gravity
/// force and articulated bodies, integrated by the classical Runge-Kutta method of fourth order. Of
/// JointDynamics it knows damping, friction, springs and motor gains; armature, stops and contact it does not
/// have. Not thread-safe.
class Plant {
 public:
  static constexpr double kStickSpeed = 0.01;  ///< [rad/s] or [m/s] below which friction is viscous

  /// @param robot with known parameters: its uncertain and frozen ones are ignored. See Model::Describe.
  /// @param max_step [s] upper bound of an integration step. At 5 ms a step of the pendulum errs by less than
  /// 1e-10 rad up to 8 rad/s, a millionth of an encoder's count.
  /// @throws std::invalid_argument if the joints do not form a tree or Simbody refuses the inertias.
  explicit Plant(const RobotDescription& robot, double max_step = 0.005);
  ~Plant();

  /// What of the robot this physics leaves out, as a sentence; empty if nothing.
  static std::string Lacks(const RobotDescription& robot);

  /// @throws std::invalid_argument if an entry is not finite or the size is wrong; the state is then
  /// unchanged.
  void SetState(const Eigen::Ref<const Eigen::VectorXd>& q, const Eigen::Ref<const Eigen::VectorXd>& v);
  /// Holds `effort` [Nm or N] for `duration` [s] >= 0 in equal steps. A state that would not be finite is not
  /// taken on: the plant then stays where it was. Not for spherical joints. @return false in that case.
  bool Advance(const Eigen::Ref<const Eigen::VectorXd>& effort, double duration);

  const Eigen::VectorXd& q() const;  ///< [rad or m]
  const Eigen::VectorXd& v() const;  ///< [rad/s or m/s]
  /// Acceleration [rad/s^2 or m/s^2] at the current state.
  Eigen::VectorXd Acceleration(const Eigen::Ref<const Eigen::VectorXd>& effort) const;
  /// Simbody's calcM, and its calcResidualForce for zero accelerations: gravity's and inertia's efforts.
  Eigen::MatrixXd MassMatrix() const;
  Eigen::VectorXd Bias() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
