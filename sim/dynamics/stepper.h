#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include "robot/drive_effort.h"
#include "sim/dynamics/constraints.h"
#include "sim/dynamics/integrate_positions.h"
#include "sim/dynamics/motor.h"
#include "sim/dynamics/physics.h"
#include "sim/dynamics/sensor_readings.h"
#include "sim/dynamics/sparse_cholesky.h"
#include "sim/dynamics/topology.h"

namespace plumb {

/// Integrates a robot over substeps of given length, with joint damping, springs, friction, stops
/// and contacts taken at the end of the substep and linearised in the velocity there ("linearly
/// implicit"), so that stiff ones need no shorter substeps:
///   (M + h D + ...) dv = h (effort - bias - D v + ...)
/// Stops, friction and contacts are settled in a few trials after the free motion, see
/// Constraints. Not thread-safe. The topology must outlive it.
///
/// Real is double or a pack. Every lane has the bits it would have alone.
template <class Real, template <class> class Tree>
class Stepper {
 public:
  Stepper(const Topology& topology, const SimulationSettings& settings, const Terms& terms)
      : topology_(topology),
        settings_(settings),
        springs_(terms.Has(&JointDynamics::stiffness)),
        loops_(terms.Has(&JointDynamics::kp) || terms.Has(&JointDynamics::kd)),
        speed_limits_(terms.Has(&JointDynamics::no_load_speed)),
        gears_lose_(terms.Has(&JointDynamics::gear_efficiency)),
        rubs_(terms.Has(&JointDynamics::friction) || gears_lose_),
        leapfrog_(settings.integrator == SimulationSettings::Integrator::kLeapfrog),
        n_(static_cast<size_t>(topology.velocities)),
        tree_(topology),
        q(static_cast<size_t>(topology.positions)),
        v(n_),
        smooth_(n_ * n_),
        matrix_(smooth_),
        drive_(n_),
        bias_(n_),
        change_(n_),
        trial_(n_),
        tried_(n_),
        shift_(n_),
        friction_(n_),
        cholesky_(n_),
        constraints_(topology, rubs_, terms.stops),
        heights_(topology.points.size()),
        jacobians_(heights_.size() * kContactDirections * n_) {}

  /// In which a contact point can be pushed: upwards, and along the ground.
  static constexpr size_t kContactDirections = 1 + Tree<Real>::kTangents;

  /// One substep of h > 0 seconds, which may differ from lane to lane. Arrays of one per velocity:
  /// @param effort mean over the substep of what is commanded.
  /// @param moment integral over the substep of (h/2 - t) effort(t) dt, or null where effort is
  /// constant: it moves the joints as an effort early in the substep moves them farther than a late
  /// one. [Nm s^2]
  void Substep(const Real& h, const Real* effort, const Real* moment) {
    if (leapfrog_) Move(Real(h / 2), v.data());
    tree_.MoveTo(physics, q.data());
    AssembleSmooth(h, effort);
    matrix_ = smooth_;
    cholesky_.Factorize(topology_.pattern, matrix_.data());
    Solve(h);
    if (leapfrog_ && topology_.coriolis) {
      // The bias of the velocity half-way, to be of second order in that, too.
      for (size_t i = 0; i < n_; ++i) trial_[i] = v[i] + 0.5 * change_[i];
      for (size_t i = 0; i < n_; ++i) drive_[i] += bias_[i];
      tree_.MoveAt(trial_.data());
      tree_.Bias(physics, bias_.data());
      for (size_t i = 0; i < n_; ++i) drive_[i] -= bias_[i];
      Solve(h);
    }
    if (moment) {
      for (size_t i = 0; i < n_; ++i) {
        shift_[i] = physics.axes[i].motor_gain * moment[i];
        if (gears_lose_) shift_[i] -= GearLoss(physics.axes[i], shift_[i]);
      }
      cholesky_.Solve(topology_.pattern, matrix_.data(), shift_.data());
    }
    Constrain(h);
    for (size_t i = 0; i < n_; ++i) v[i] += change_[i];
    if (!settings_.move_before_clip) Clip();
    Move(Ahead(h), v.data());
    if (moment) Move(Real{} + 1, shift_.data());
    if (settings_.move_before_clip) Clip();
  }

  /// Accelerations at q, v without stops, contacts and Coulomb friction: one per velocity.
  const Real* Acceleration(const Real* effort) {
    tree_.MoveTo(physics, q.data());
    AssembleSmooth(Real{}, effort);
    matrix_ = smooth_;
    cholesky_.Factorize(topology_.pattern, matrix_.data());
    Solve(Real{} + 1);
    return change_.data();
  }

  /// Lower triangle with armature, row by row, and the bias at q, v.
  const Real* MassMatrix() {
    tree_.MoveTo(physics, q.data());
    AssembleSmooth(Real{}, bias_.data());
    return smooth_.data();
  }
  const Real* Bias() {
    tree_.MoveTo(physics, q.data());
    tree_.MoveAt(v.data());
    tree_.Bias(physics, bias_.data());
    return bias_.data();
  }

  /// [m] of each contact point's lowest spot above the ground, at q.
  const Real* ContactHeights() {
    tree_.MoveTo(physics, q.data());
    for (size_t p = 0; p < heights_.size(); ++p) heights_[p] = tree_.Height(physics, p);
    return heights_.data();
  }
  /// Those spots' Jacobians, at the q of ContactHeights: kContactDirections rows each.
  const Real* ContactJacobians() {
    for (size_t p = 0; p < heights_.size(); ++p)
      tree_.Jacobian(physics, p, &jacobians_[p * kContactDirections * n_]);
    return jacobians_.data();
  }
  /// The change of velocities that an impulse makes, at the q of the latest Acceleration.
  const Real* Response(const Real* impulse) {
    for (size_t i = 0; i < n_; ++i) change_[i] = impulse[i];
    cholesky_.Solve(topology_.pattern, matrix_.data(), change_.data());
    return change_.data();
  }

  /// q, v are readings of sensors (JointDynamics): makes them the state that these are of, to
  /// second order in the delay, and back.
  void FromReading(const Real* effort) {
    RemoveSensorBias(topology_, physics, q.data(), v.data());
    const Real* acceleration = Felt(effort);
    RemoveSensorDelay(topology_, physics, acceleration, q.data(), v.data());
  }
  void ToReading(const Real* effort) {
    const Real* acceleration = Felt(effort);
    AddSensorErrors(topology_, physics, acceleration, q.data(), v.data());
  }

  Physics<Real> physics;  // the robot; first, as it is aligned the most. Its sizes are fixed

 private:
  using Truth = Mask<Real>;

  const Topology& topology_;
  SimulationSettings settings_;
  bool springs_, loops_, speed_limits_, gears_lose_, rubs_;  // whether any joint may have them
  bool leapfrog_;
  size_t n_;
  Tree<Real> tree_;

 public:
  std::vector<Real> q, v;  // the robot's state before and after a step. Sizes are fixed

 private:
  // One substep's work space.
  std::vector<Real> smooth_;  // matrix without stops, contacts and friction
  std::vector<Real> matrix_;  // with them; then its factors
  std::vector<Real> drive_;   // forces without them
  std::vector<Real> bias_, change_, trial_, tried_, shift_, friction_;
  SparseCholesky<Real> cholesky_;
  Constraints<Real, Tree> constraints_;
  std::vector<Real> heights_, jacobians_;  // of contact points, for ContactHeights

  void AssembleSmooth(const Real& h, const Real* effort) {
    tree_.MoveAt(v.data());
    tree_.MassMatrix(physics, smooth_.data());
    tree_.Bias(physics, bias_.data());
    // of the substep's end in the velocity that damping sees
    const double share = leapfrog_ ? 0.5 : 1;
    for (size_t i = 0; i < n_; ++i) {
      const auto& axis = physics.axes[i];
      drive_[i] = axis.motor_gain * effort[i] - bias_[i] - axis.damping * v[i];
      smooth_[i * n_ + i] += axis.armature + share * h * axis.damping;
      if (rubs_) friction_[i] = axis.friction;
    }
    if (loops_ || speed_limits_ || gears_lose_ || springs_) AssembleJoints(h, effort);
  }

  void AssembleJoints(const Real& h, const Real* effort) {
    for (const Topology::Joint& joint : topology_.joints) {
      if (joint.type == JointDescription::Type::kSpherical) continue;
      const auto i = static_cast<size_t>(joint.velocity);
      const auto& axis = physics.axes[i];
      Real acting = effort[i];
      if (joint.effort_limit > 0 && (loops_ || speed_limits_)) {
        const Real position = q[static_cast<size_t>(joint.position)],
                   asked = loops_ ? LoopEffort(axis, effort[i], position, v[i]) : effort[i];
        acting = asked;
        if (loops_)
          acting = Clamp(acting, Real{} - joint.effort_limit, Real{} + joint.effort_limit);
        if (speed_limits_) acting = SlowedEffort(axis, acting, v[i], joint.effort_limit);
        drive_[i] += axis.motor_gain * (acting - effort[i]);
        if (loops_) GoOn(h, i, Abs(Real(acting - asked)) > 0);
      }
      if (gears_lose_) {
        const Real loss = GearLoss(axis, Real(axis.motor_gain * acting));
        drive_[i] -= loss;
        friction_[i] += Abs(loss);
      }
      if (springs_) {
        // At the end of the substep; for the leapfrog at the mean of both ends (implicit midpoint).
        const Real stretch = q[static_cast<size_t>(joint.position)] - axis.rest;
        drive_[i] -= axis.stiffness * (leapfrog_ ? stretch : Real(stretch + h * v[i]));
        smooth_[i * n_ + i] += (leapfrog_ ? 0.25 : 1.0) * h * h * axis.stiffness;
      }
    }
  }

  // A loop's springing and damping go on to the substep's end, as a spring's do; where the motor is
  // at a limit nothing of them is left.
  void GoOn(const Real& h, size_t i, const Truth& limited) {
    const auto& axis = physics.axes[i];
    const Real spring = limited ? Real{} : Real(axis.motor_gain * axis.kp),
               damper = limited ? Real{} : Real(axis.motor_gain * axis.kd);
    smooth_[i * n_ + i] += leapfrog_ ? Real(0.25 * h * h * spring + 0.5 * h * damper)
                                     : Real(h * (h * spring + damper));
    if (!leapfrog_) drive_[i] -= h * spring * v[i];
  }

  void Solve(const Real& h) {
    for (size_t i = 0; i < n_; ++i) change_[i] = h * drive_[i];
    cholesky_.Solve(topology_.pattern, matrix_.data(), change_.data());
  }

  // Accelerations with all that acts, over one substep from here.
  const Real* Felt(const Real* effort) {
    const Real h = Real{} + settings_.substep;
    tree_.MoveTo(physics, q.data());
    AssembleSmooth(h, effort);
    matrix_ = smooth_;
    cholesky_.Factorize(topology_.pattern, matrix_.data());
    Solve(h);
    Constrain(h);
    for (Real& change : change_) change /= h;
    return change_.data();
  }

  // Changes the free motion into that with stops, friction and contacts, if any of them acts. A
  // lane whose trial has settled keeps it, however long others try.
  void Constrain(const Real& h) {
    const typename Constraints<Real, Tree>::Substep now{physics,          q.data(), v.data(),
                                                        friction_.data(), h,        Ahead(h)};
    for (size_t i = 0; i < n_; ++i) trial_[i] = v[i] + change_[i];
    if (!constraints_.Find(now, tree_, trial_.data())) return;
    Mask<Real> open = Real{} < 1;
    for (int trial = 1; trial <= constraints_.kMaxTrials; ++trial) {
      constraints_.Foresee(now, trial_.data(), cholesky_, matrix_.data());
      matrix_ = smooth_;
      for (size_t i = 0; i < n_; ++i) tried_[i] = h * drive_[i];
      constraints_.Assemble(now, trial_.data(), matrix_.data(), tried_.data());
      cholesky_.Factorize(topology_.pattern, matrix_.data());
      cholesky_.Solve(topology_.pattern, matrix_.data(), tried_.data());
      for (size_t i = 0; i < n_; ++i) change_[i] = open ? tried_[i] : change_[i];
      for (size_t i = 0; i < n_; ++i) trial_[i] = v[i] + tried_[i];
      const Mask<Real> settled = constraints_.Judge(now, trial_.data());
      if (trial >= constraints_.kFewestTrials) open = open & (settled == 0);
      if (!Any(open)) return;
    }
  }

  Real Ahead(const Real& h) const {
    return leapfrog_ ? Real(h / 2) : h;
  }  // to the substep's end, from where q is

  void Clip() {
    if (!(settings_.speed_clip < std::numeric_limits<double>::infinity())) return;
    for (Real& speed : v) {
      // A speed that has become infinite must not look bounded again: inf - inf is NaN.
      speed = Clamp(speed, Real{} - settings_.speed_clip, Real{} + settings_.speed_clip) +
              (speed - speed);
    }
  }

  void Move(const Real& h, const Real* velocity) {
    IntegratePositions(topology_, h, velocity, q.data());
  }
};

}  // namespace plumb
