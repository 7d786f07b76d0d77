#pragma once

#include <Eigen/Core>
#include <memory>

#include "robot/description.h"
#include "sim/virtual/physics_backend.h"

namespace plumb {

/// Simbody as what moves a robot that touches the ground: see SimbodyTree, with contacts and stops
/// of its own. A sphere, or an end of a capsule, touches the ground by
/// SimTK::SmoothSphereHalfSpaceForce: Hertz, Hunt and Crossley, and friction by Stribeck, whose
/// formulas are in its header. The robot's contact friction is the static one. Stops are
/// SimTK::Force::MobilityLinearStop. Armature, damping, friction and springs are the robot's; as
/// Simbody has no armature, the accelerations come from its mass matrix with that on the diagonal.
///
/// Integrated by the Runge-Kutta pair of Bogacki and Shampine ("A 3(2) pair of Runge-Kutta
/// formulas", Appl. Math. Lett. 2, 1989) with steps that its error decides on. The same calls give
/// the same bits. Not thread-safe.
class SimbodyBackend : public PhysicsBackend {
 public:
  // The ground and what touches it, as of hard rubber.
  static constexpr double kModulus = 1e7;       ///< [Pa] plane-strain, of both; x stiffness_factor
  static constexpr double kDissipation = 1;     ///< [s/m]
  static constexpr double kDynamicShare = 0.8;  ///< of the static friction
  static constexpr double kViscous = 0.01;      ///< [s/m]
  static constexpr double kTransition = 0.1;    ///< [m/s] below which friction is viscous
  static constexpr double kSmoothDepth = 1e-6;  ///< [m^2], "cf"
  static constexpr double kHertzSmoothing = 1000;         ///< [1/m], "bd"
  static constexpr double kHuntCrossleySmoothing = 1000;  ///< [s/m], "bv"
  // Stops.
  static constexpr double kStopStiffness = 2e4;    ///< [Nm/rad] or [N/m]
  static constexpr double kStopDissipation = 0.5;  ///< [s/rad] or [s/m]
  // Joints.
  static constexpr double kStickSpeed = 0.01;  ///< [rad/s] or [m/s] below which friction is viscous
  // Steps.
  static constexpr double kLongestStep = 1e-3, kShortestStep = 1e-7;  ///< [s]
  static constexpr double kTolerance = 1e-4;  ///< on the error of v in a step, x (1 + |v|)

  /// @param robot with known parameters, see Model::Describe.
  /// @throws std::invalid_argument naming what of the robot cannot be told.
  explicit SimbodyBackend(const RobotDescription& robot);
  ~SimbodyBackend() override;

  void SetState(const Vector& q, const Vector& v) override;
  bool Advance(const Vector& effort, double duration) override;
  const Eigen::VectorXd& q() const override;
  const Eigen::VectorXd& v() const override;

  /// [rad/s^2 or m/s^2] at the current state.
  Eigen::VectorXd Acceleration(const Vector& effort) const;
  /// [N] of the ground on the robot at the current state, all contacts together.
  Eigen::Vector3d GroundForce() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// As a new one. @throws std::invalid_argument as its constructor. Thread-safe.
std::unique_ptr<PhysicsBackend> MakeSimbodyBackend(const RobotDescription& robot);

}  // namespace plumb
