#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "sim/dynamics/physics.h"
#include "sim/dynamics/sparse_cholesky.h"
#include "sim/dynamics/topology.h"

namespace plumb {

/// Forces that act only sometimes, or not in proportion: joint stops, Coulomb friction,
/// contact with the ground. All of it is taken at the end of a substep of h seconds, linear in the
/// velocity v + dv there: force = f - b (v + dv) adds h b to the matrix and h (f - b v) to the
/// right-hand side of  matrix dv = rhs.
///
/// Whether something pushes, and by which speed friction is to be divided (Coulomb's force is mu
/// f_n v / |v|, viscous below a small speed), is found by trial: Find with the free motion; then
/// Foresee, Assemble, solve and Judge until that has settled. Work space of one Stepper; not
/// thread-safe. The topology must outlive it.
template <class Real, template <class> class Tree>
class Constraints {
 public:
  /// [rad/s] or [m/s] below which joint friction is viscous
  static constexpr double kStickSpeed = 0.01;

  /// @param rubs, stops whether any joint may have friction, or stops.
  Constraints(const Topology& topology, bool rubs, bool stops)
      : topology_(topology),
        rubs_(rubs),
        stops_(stops),
        n_(static_cast<size_t>(topology.velocities)),
        shift_(n_),
        rubbed_(n_),
        outcome_(n_),
        contacts_(topology.points.size()),
        rows_(topology.points.size() * kRows * n_) {}

  /// Where the substep stands. Positions are those at which forces are evaluated, `ahead` seconds
  /// before its end.
  struct Substep {
    const Physics<Real>& physics;
    const Real* q;
    const Real* v;
    const Real* friction;  ///< [Nm] or [N] of each joint's Coulomb friction, if there is any
    Real h, ahead;
  };

  /// Looks which constraints act if the velocities become `trial`. False: none does, and nothing
  /// need be assembled.
  bool Find(const Substep& now, const Tree<Real>& tree, const Real* trial) {
    bool any = rubs_;
    std::fill(rubbed_.begin(), rubbed_.end(), Real{});
    for (const Topology::Joint& joint : topology_.joints) {
      if (any || !HasStop(joint)) continue;
      Real depth, sign;
      StopDepth(joint, now.q, &depth, &sign);
      any = Any(depth - now.ahead * sign * trial[joint.velocity] > 0);
    }
    for (size_t p = 0; p < contacts_.size(); ++p) {
      Contact& contact = contacts_[p];
      contact = Contact{};
      contact.depth = -tree.Height(now.physics, p);
      tree.Jacobian(now.physics, p, &rows_[p * kRows * n_]);
      contact.active = contact.depth - now.ahead * Along(p, 0, trial) > 0;
      contact.any = Any(contact.active);
      any = any || contact.any;
    }
    return any;
  }

  /// Friction divides by the speed that it will leave, so that a sliding point slows evenly and a
  /// sticking one stops at once. That speed is the trial's, less the change that friction at its
  /// full force makes beyond the friction of the trial.
  /// @param factors of the trial's matrix.
  void Foresee(const Substep& now, const Real* trial, const SparseCholesky<Real>& cholesky,
               const Real* factors) {
    std::fill(shift_.begin(), shift_.end(), Real{});
    bool rubs = rubs_;
    for (size_t i = 0; rubs_ && i < n_; ++i) {
      const Real full = trial[i] < 0 ? Real(-now.friction[i]) : now.friction[i];
      shift_[i] = now.h * (full - rubbed_[i] * trial[i]);
    }
    for (size_t p = 0; p < contacts_.size(); ++p) {
      Contact& contact = contacts_[p];
      contact.outcome = Max(contact.speed, now.physics.world.contact.slip_speed);
      if (!contact.any || !Any(contact.pressure > 0)) continue;  // as in the first trial
      rubs = true;
      const Real more = now.physics.world.contact.friction * contact.pressure - contact.gripped;
      for (size_t t = 1; t < kRows; ++t) {
        const Real force = contact.active ? Real(now.h * more * contact.along[t]) : Real{};
        const Real* row = Row(p, t);
        for (int i = Last(p); i >= 0; i = Ancestor(i))
          shift_[static_cast<size_t>(i)] += row[i] * force;
      }
    }
    if (!rubs) return;
    cholesky.Solve(topology_.ancestors, factors, shift_.data());
    for (size_t i = 0; rubs_ && i < n_; ++i) {
      const Real taken = trial[i] < 0 ? Real(-shift_[i]) : shift_[i];
      outcome_[i] = Max(Real(Abs(trial[i]) - taken), Real{} + kStickSpeed);
    }
    for (size_t p = 0; p < contacts_.size(); ++p) {
      Contact& contact = contacts_[p];
      if (!contact.any) continue;
      Real taken{};
      for (size_t t = 1; t < kRows; ++t) taken += contact.along[t] * Along(p, t, shift_.data());
      contact.outcome = Max(Real(contact.speed - taken), now.physics.world.contact.slip_speed);
    }
  }

  /// Adds what acts to the matrix (lower triangle, row by row) and to the right-hand side.
  void Assemble(const Substep& now, const Real* trial, Real* matrix, Real* rhs) {
    const WorldOf<Real>& world = now.physics.world;
    for (size_t i = 0; rubs_ && i < n_; ++i) {
      rubbed_[i] = now.friction[i] / outcome_[i];
      matrix[i * n_ + i] += now.h * rubbed_[i];
      rhs[i] -= now.h * rubbed_[i] * now.v[i];
    }
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
    for (size_t p = 0; p < contacts_.size(); ++p) {
      Contact& contact = contacts_[p];
      if (!contact.any) continue;
      const Real push = contact.active ? world.contact.stiffness * contact.depth : Real{};
      AddForce(now, p, 0, push, contact.active ? Slope(now) : Real{}, matrix, rhs);
      const Real grip = world.contact.friction * contact.pressure / contact.outcome;
      contact.gripped = contact.active ? grip : Real{};
      if (!Any(grip > 0)) continue;
      for (size_t t = 1; t < kRows; ++t) {
        AddForce(now, p, t, Real{}, contact.active ? grip : Real{}, matrix, rhs);
      }
    }
  }

  /// Updates the contacts to the velocities `trial`: the next trial starts from there. True
  /// where it may be the last, because the same contacts act as in it and none of their forces is
  /// outside the cone of friction.
  Mask<Real> Judge(const Substep& now, const Real* trial) {
    constexpr double kSlack = 1.02;
    Truth settled = Real{} < 1;
    for (size_t p = 0; p < contacts_.size(); ++p) {
      Contact& contact = contacts_[p];
      // One that was far may be pushed into the ground by another, one that pushed may have been
      // pushed out.
      const Real rising = Along(p, 0, trial);
      const Real force = now.physics.world.contact.stiffness * contact.depth - Slope(now) * rising;
      const Truth acts = (contact.depth - now.ahead * rising > 0) & (force > 0);
      settled = settled & (acts == contact.active);
      contact.active = acts;
      contact.any = contact.any || Any(acts);
      if (!contact.any) continue;
      contact.pressure = Max(force, Real{});
      Real squared{};
      for (size_t t = 1; t < kRows; ++t) {
        contact.along[t] = Along(p, t, trial);
        squared += contact.along[t] * contact.along[t];
      }
      contact.speed = Sqrt(squared);
      for (size_t t = 1; t < kRows; ++t) {
        contact.along[t] = contact.speed > 0 ? Real(contact.along[t] / contact.speed) : Real{};
      }
      contact.gripped *= contact.speed;
      // Not: is inside. What is not finite will not settle, and must not look unsettled only beside
      // others.
      const Truth beyond =
          contact.gripped > kSlack * now.physics.world.contact.friction * contact.pressure;
      settled = settled & (beyond == 0);
    }
    return settled;
  }

 private:
  static constexpr size_t kRows = 1 + Tree<Real>::kTangents;  // upwards, and along the ground
  using Truth = Mask<Real>;

  struct Contact {
    Truth active;
    Real depth;         // where forces are evaluated
    Real pressure;      // normal force of the latest trial
    Real speed;         // along the ground, then
    Real along[kRows];  // and which way: of length one, behind an unused entry
    Real gripped;       // force of friction in that trial; while it is assembled, per speed
    Real outcome;       // speed that friction will leave
    bool any;           // active in some lane
  };

  int Ancestor(int velocity) const { return topology_.ancestors[static_cast<size_t>(velocity)]; }
  const Real* Row(size_t point, size_t direction) const {
    return &rows_[(point * kRows + direction) * n_];
  }

  // The last velocity that moves the point.
  int Last(size_t point) const {
    const int link = topology_.points[point].link;
    if (link == 0) return -1;
    const Topology::Joint& joint = topology_.joints[static_cast<size_t>(link - 1)];
    return joint.velocity + (joint.type == JointDescription::Type::kSpherical ? 2 : 0);
  }

  Real Along(size_t point, size_t direction, const Real* velocity) const {
    const Real* row = Row(point, direction);
    Real sum{};
    for (int i = Last(point); i >= 0; i = Ancestor(i)) sum += row[i] * velocity[i];
    return sum;
  }

  // Of a contact's force in the velocity.
  Real Slope(const Substep& now) const {
    return now.physics.world.contact.stiffness * now.ahead + now.physics.world.contact.damping;
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

  // force = at_rest - slope * row . (v + dv), acting along the row
  void AddForce(const Substep& now, size_t point, size_t direction, const Real& at_rest,
                const Real& slope, Real* matrix, Real* rhs) const {
    const Real* row = Row(point, direction);
    const Real force = now.h * (at_rest - slope * Along(point, direction, now.v));
    for (int i = Last(point); i >= 0; i = Ancestor(i)) {
      const Real scaled = now.h * slope * row[i];
      rhs[i] += row[i] * force;
      Real* entries = matrix + static_cast<size_t>(i) * n_;
      for (int j = i; j >= 0; j = Ancestor(j)) entries[j] += scaled * row[j];
    }
  }

  const Topology& topology_;
  bool rubs_, stops_;
  size_t n_;
  std::vector<Real> shift_;  // of the velocities, by friction
  std::vector<Real> rubbed_,
      outcome_;  // joint friction per speed in the latest trial; speed that it will leave
  std::vector<Contact> contacts_;
  std::vector<Real> rows_;  // the contacts' Jacobians
};

}  // namespace plumb
