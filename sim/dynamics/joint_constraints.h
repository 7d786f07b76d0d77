#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "sim/dynamics/physics.h"
#include "sim/dynamics/real.h"
#include "sim/dynamics/topology.h"

namespace plumb {

/// Where a substep of h seconds stands. Positions are those at which forces are evaluated, `ahead`
/// seconds before its end. Plain data.
template <class Real>
struct ConstrainedSubstep {
  const Physics<Real>& physics;
  const Real* q;
  const Real* v;
  const Real* friction;  ///< [Nm] or [N] of each joint's Coulomb friction, if there is any
  Real h, ahead;
};

/// The part of Constraints that acts on joints, one by one: their stops and Coulomb friction. A
/// trial goes through the same calls as there. Arrays have one entry per velocity. Not thread-safe.
/// The topology must outlive it.
/// @tparam kSlides what is foreseen to slide has its full force, whatever speed is left.
template <class Real, bool kSlides>
class JointConstraints {
 public:
  /// [rad/s] or [m/s] below which friction is viscous
  static constexpr double kStickSpeed = 0.01;

  /// @param rubs, stops whether any joint may have friction, or stops.
  JointConstraints(const Topology& topology, bool rubs, bool stops)
      : topology_(topology),
        rubs_(rubs),
        stops_(stops),
        n_(static_cast<size_t>(topology.velocities)),
        rubbed_(n_),
        pushed_(n_),
        outcome_(n_) {}

  bool rubs() const { return rubs_; }

  /// Whether any acts if the velocities become `trial`, the first.
  bool Find(const ConstrainedSubstep<Real>& now, const Real* trial) {
    bool any = rubs_;
    first_ = true;
    std::fill(rubbed_.begin(), rubbed_.end(), Real{});
    std::fill(pushed_.begin(), pushed_.end(), Real{});
    for (const Topology::Joint& joint : topology_.joints) {
      if (any || !HasStop(joint)) continue;
      Real depth, sign;
      StopDepth(joint, now.q, &depth, &sign);
      any = Any(depth - now.ahead * sign * trial[joint.velocity] > 0);
    }
    return any;
  }

  /// Sets the impulses by which friction at its full force exceeds that of the trial, where joints
  /// rub.
  void FindMoreFriction(const ConstrainedSubstep<Real>& now, const Real* trial,
                        Real* impulses) const {
    for (size_t i = 0; rubs_ && i < n_; ++i) {
      const Real full = trial[i] < 0 ? Real(-now.friction[i]) : now.friction[i];
      impulses[i] = now.h * (full - pushed_[i] - rubbed_[i] * trial[i]);
    }
  }

  /// @param shift by which those impulses, and those of contacts, change the velocities.
  void Foresee(const Real* trial, const Real* shift) {
    for (size_t i = 0; rubs_ && i < n_; ++i) {
      const Real taken = trial[i] < 0 ? Real(-shift[i]) : shift[i];
      outcome_[i] = Max(Real(Abs(trial[i]) - taken), Real{} + kStickSpeed);
    }
  }

  /// Adds what acts to the matrix (lower triangle, row by row) and to the right-hand side.
  void Assemble(const ConstrainedSubstep<Real>& now, const Real* trial, Real* matrix, Real* rhs) {
    AddFriction(now, trial, matrix, rhs);
    AddStops(now, trial, matrix, rhs);
  }

  /// Whether friction is as it must be at the velocities `trial` that it has led to.
  Mask<Real> Judge(const ConstrainedSubstep<Real>& now, const Real* trial, double slack) const {
    Truth settled = Real{} < 1;
    for (size_t i = 0; kSlides && rubs_ && i < n_; ++i) {
      const Truth beyond = rubbed_[i] * Abs(trial[i]) > slack * now.friction[i],
                  back = pushed_[i] * trial[i] < 0;
      settled = settled & (beyond == 0) & (back == 0);
    }
    return settled;
  }

 private:
  using Truth = Mask<Real>;

  void AddFriction(const ConstrainedSubstep<Real>& now, const Real* trial, Real* matrix,
                   Real* rhs) {
    for (size_t i = 0; rubs_ && i < n_; ++i) {
      rubbed_[i] = now.friction[i] / outcome_[i];
      if constexpr (kSlides) {
        // What is foreseen once is then held to what has come of it: others have changed, too.
        const Truth slid = Abs(pushed_[i]) > 0,
                    still = slid ? pushed_[i] * trial[i] >= 0 : Abs(trial[i]) > kStickSpeed,
                    slides = first_ ? outcome_[i] > kStickSpeed : still;
        const Real full = trial[i] < 0 ? Real(-now.friction[i]) : now.friction[i];
        rubbed_[i] = slides ? Real{} : rubbed_[i];
        pushed_[i] = slides ? full : Real{};
        rhs[i] -= now.h * pushed_[i];
      }
      matrix[i * n_ + i] += now.h * rubbed_[i];
      rhs[i] -= now.h * rubbed_[i] * now.v[i];
    }
    first_ = false;
  }

  void AddStops(const ConstrainedSubstep<Real>& now, const Real* trial, Real* matrix,
                Real* rhs) const {
    const WorldOf<Real>& world = now.physics.world;
    for (const Topology::Joint& joint : topology_.joints) {
      if (!HasStop(joint)) continue;
      const auto i = static_cast<size_t>(joint.velocity);
      Real depth, sign;
      StopDepth(joint, now.q, &depth, &sign);
      const Real slope = world.stop.stiffness * now.ahead + world.stop.damping;
      const Real force = world.stop.stiffness * depth - slope * sign * trial[i];
      const Truth acts = (depth - now.ahead * sign * trial[i] > 0) & (force > 0);
      matrix[i * n_ + i] += acts ? now.h * slope : Real{};
      rhs[i] += acts ? now.h * (sign * world.stop.stiffness * depth - slope * now.v[i]) : Real{};
    }
  }

  bool HasStop(const Topology::Joint& joint) const {
    return stops_ && joint.upper < std::numeric_limits<double>::infinity() &&
           joint.type != JointDescription::Type::kSpherical;
  }

  // How far the joint is beyond its nearer limit, and which way that pushes.
  void StopDepth(const Topology::Joint& joint, const Real* q, Real* depth, Real* sign) const {
    const Real below = joint.lower - q[joint.position], above = q[joint.position] - joint.upper;
    const Truth low = below > above;
    *depth = low ? below : above;
    *sign = low ? Real{} + 1 : Real{} - 1;
  }

  const Topology& topology_;
  bool rubs_, stops_;
  size_t n_;
  // In the latest trial: friction per speed where a joint sticks, friction where it slides, and the
  // speed that it will leave.
  std::vector<Real> rubbed_, pushed_, outcome_;
  bool first_ = true;  // no trial has been assembled yet
};

}  // namespace plumb
