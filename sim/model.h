#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>

#include "robot/description.h"

namespace plumb {

/// An effort that is held for some time.
struct EffortSegment {
  double duration;         ///< [s], >= 0
  Eigen::VectorXd effort;  ///< [Nm or N] per joint
};

/// The robot as a simulator with exchangeable parameters: a tree of one-degree-of-freedom joints, kinematics
/// by Simbody, mass matrix by composite rigid bodies (Featherstone, "Rigid Body Dynamics Algorithms", 2008,
/// section 6.2) over a mass table of its own, so that new parameters need no rebuild. Joint stops, friction
/// and contact are not modelled.
///
/// One per worker; not thread-safe, but instances share nothing. Equal inputs give equal bits in any thread.
/// Apart from construction nothing allocates.
class Simulator {
 public:
  using Vector = Eigen::Ref<const Eigen::VectorXd>;

  /// Starts at the zero state with the prior means as parameters.
  /// @throws std::invalid_argument if the joints do not form a tree or a parameter is unknown.
  explicit Simulator(const RobotDescription& description);
  Simulator(Simulator&&) noexcept;
  Simulator& operator=(Simulator&&) noexcept;
  ~Simulator();

  int num_joints() const;
  int parameter_count() const;

  /// @param physical in the order of description.parameters, physical units. Takes effect at once; the state
  /// stays. @throws std::invalid_argument, see Parameters::Apply.
  void SetParameters(const Vector& physical);
  /// @throws std::invalid_argument if an entry is not finite or the size is wrong.
  void SetState(const Vector& q, const Vector& v);

  /// Holds `effort` for `duration` [s] >= 0, in equal substeps of at most settings.substep:
  ///   semi-implicit  v += h a(q, v), q += h v: of first order, as gym does
  ///   leapfrog       q += h/2 v, v += h a(q, v), q += h/2 v: of second order in everything but the velocity
  ///                  dependence of a, i.e. altogether for robots without Coriolis terms
  /// Velocities are clipped to settings.speed_clip after each substep (settings.move_before_clip: after the
  /// move). If the state ceases to be finite it stays so until the next SetState, without any exception.
  void Step(const Vector& effort, double duration);
  /// The same for efforts one after the other: the profile that was really applied to a robot.
  void Step(std::span<const EffortSegment> profile);

  const Eigen::VectorXd& q() const;  ///< [rad or m]
  const Eigen::VectorXd& v() const;  ///< [rad/s or m/s]
  /// False once the state has blown up, or an effort was not finite.
  bool finite() const;

  /// Acceleration at the current state under `effort` [rad/s^2 or m/s^2]. Valid until the next call of
  /// anything.
  const Eigen::VectorXd& Acceleration(const Vector& effort);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
