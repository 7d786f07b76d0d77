#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>

#include "robot/description.h"
#include "sim/virtual/physics_backend.h"

namespace plumb {

/// The physics of the virtual robot: what stands for reality. It shares neither equations nor
/// integrator with Simulator, so that the two agree only because both are right: Simbody the
/// textbook way, with a gravity force and articulated bodies, integrated by the classical
/// Runge-Kutta method of fourth order. Of JointDynamics it knows damping, friction, springs and
/// motor gains; armature, stops and contact it does not have. Not thread-safe.
class SimbodyPlant : public PhysicsBackend {
 public:
  static constexpr double kStickSpeed = 0.01;  ///< [rad/s] or [m/s] below which friction is viscous

  /// @param robot with known parameters: its uncertain and frozen ones are ignored. See
  /// Model::Describe.
  /// @param max_step [s] upper bound of an integration step. At 5 ms a step of the pendulum errs by
  /// less than 1e-10 rad up to 8 rad/s, a millionth of an encoder's count.
  /// @throws std::invalid_argument if the joints do not form a tree or Simbody refuses the
  /// inertias.
  explicit SimbodyPlant(const RobotDescription& robot, double max_step = 0.005);
  ~SimbodyPlant() override;

  /// Parts of the robot that this physics leaves out, as a sentence; empty if none.
  static std::string Lacks(const RobotDescription& robot);

  void SetState(const Vector& q, const Vector& v) override;
  /// In equal steps. Not for spherical joints.
  bool Advance(const Vector& effort, double duration) override;

  const Eigen::VectorXd& q() const override;
  const Eigen::VectorXd& v() const override;
  /// Acceleration [rad/s^2 or m/s^2] at the current state.
  Eigen::VectorXd Acceleration(const Eigen::Ref<const Eigen::VectorXd>& effort) const;
  /// Simbody's calcM, and its calcResidualForce for zero accelerations: gravity's and inertia's
  /// efforts.
  Eigen::MatrixXd MassMatrix() const;
  Eigen::VectorXd Bias() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
