#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "sim/dynamics/contact.h"
#include "sim/dynamics/joint_constraints.h"
#include "sim/dynamics/link_contacts.h"
#include "sim/dynamics/physics.h"
#include "sim/dynamics/sparse_cholesky.h"
#include "sim/dynamics/topology.h"

namespace plumb {

/// Forces that act only sometimes, or not in proportion: joint stops, Coulomb friction, contact
/// with the ground and of links with each other. All of it is taken at the end of a substep of h
/// seconds, linear in the velocity v + dv there: force = f - b (v + dv) adds h b to the matrix and
/// h (f - b v) to the right-hand side of  matrix dv = rhs.
///
/// Whether something pushes, and by which speed friction is to be divided (Coulomb's force is mu
/// f_n v / |v|, viscous below a small speed), is found by trial: Find with the free motion; then
/// Foresee, Assemble, solve and Judge until that has settled. In space, where many feet and joints
/// rub at once and none knows what the others leave it, what is foreseen to slide has its full
/// force, whatever speed is left; else some that would stick slid with too little of it. Work space
/// of one Stepper; not thread-safe. The topology must outlive it.
template <class Real, template <class> class Tree>
class Constraints {
 public:
  /// [rad/s] or [m/s] below which joint friction is viscous
  static constexpr double kStickSpeed =
      JointConstraints<Real, Tree<Real>::kTangents == 2>::kStickSpeed;

  static constexpr int kFewestTrials = 2,
                       kMaxTrials = Tree<Real>::kTangents == 2 ? 8 : 4;  ///< then it goes on as is

  /// @param rubs, stops whether any joint may have friction, or stops.
  Constraints(const Topology& topology, bool rubs, bool stops)
      : topology_(topology),
        n_(static_cast<size_t>(topology.velocities)),
        shift_(n_),
        joints_(topology, rubs, stops),
        links_(topology),
        contacts_(topology.points.size() + links_.size()),
        rows_(contacts_.size() * kRows * n_),
        across_(n_) {
    size_t p = 0;
    for (const Topology::Point& point : topology.points)
      contacts_[p++].chain = {topology.LastVelocity(point.link), topology.ancestors.data()};
    for (const Topology::Pair& pair : topology.pairs) {
      const int first = topology.LastVelocity(topology.solids[pair.first].link),
                second = topology.LastVelocity(topology.solids[pair.second].link);
      for (size_t k = 0; k < pair.spots; ++k)
        contacts_[p++].chain = {std::max(first, second), topology.pattern.data()};
    }
  }

  using Substep = ConstrainedSubstep<Real>;

  /// Looks which constraints act if the velocities become `trial`. False: none does, and nothing
  /// need be assembled.
  bool Find(const Substep& now, const Tree<Real>& tree, const Real* trial) {
    bool any = joints_.Find(now, trial);
    for (size_t p = 0; p < topology_.points.size(); ++p) {
      tree.Jacobian(now.physics, p, &rows_[p * kRows * n_]);
      any = Begin(now, p, -tree.Height(now.physics, p), trial) || any;
    }
    if constexpr (Tree<Real>::kTangents == 2) {
      if (links_.size() > 0) any = FindLinks(now, tree, trial) || any;
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
    bool rubs = joints_.rubs();
    joints_.FindMoreFriction(now, trial, shift_.data());
    for (size_t p = 0; p < contacts_.size(); ++p) {
      Contact& contact = contacts_[p];
      contact.outcome = Max(contact.speed, now.physics.world.contact.slip_speed);
      if (!contact.any || !Any(contact.pressure > 0)) continue;  // as in the first trial
      rubs = true;
      const Real full = now.physics.world.contact.friction * contact.pressure;
      for (size_t t = 1; t < kRows; ++t) {
        const Real more = full * contact.along[t] - contact.rubbed[t],
                   force = contact.active ? Real(now.h * more) : Real{};
        const Real* row = Row(p, t);
        for (int i = contact.chain.last; i >= 0; i = contact.chain.before[i])
          shift_[static_cast<size_t>(i)] += row[i] * force;
      }
    }
    if (!rubs) return;
    cholesky.Solve(topology_.pattern, factors, shift_.data());
    joints_.Foresee(trial, shift_.data());
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
    joints_.Assemble(now, trial, matrix, rhs);
    for (size_t p = 0; p < contacts_.size(); ++p) {
      Contact& contact = contacts_[p];
      if (!contact.any) continue;
      const Real push = contact.active ? world.contact.stiffness * contact.depth : Real{};
      AddForce(now, p, 0, push, contact.active ? Slope(now) : Real{}, matrix, rhs);
      const Real full = contact.active ? Real(world.contact.friction * contact.pressure) : Real{};
      contact.Grip(full, world.contact.slip_speed);
      if (!Any(full > 0)) continue;
      for (size_t t = 1; t < kRows; ++t)
        AddForce(now, p, t, Real(Real{} - contact.pushed[t]), contact.grip, matrix, rhs);
      if constexpr (kSlides) AddAcross(now, p, matrix, rhs);
    }
  }

  /// Updates the contacts to the velocities `trial`: the next trial starts from there. True
  /// where it may be the last, because the same contacts act as in it and none of their forces is
  /// outside the cone of friction.
  Mask<Real> Judge(const Substep& now, const Real* trial) {
    constexpr double kSlack = 1.02;
    Truth settled = joints_.Judge(now, trial, kSlack);
    for (size_t p = 0; p < contacts_.size(); ++p) {
      Contact& contact = contacts_[p];
      if (!contact.near) continue;
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
      Real velocity[kRows];
      for (size_t t = 1; t < kRows; ++t) velocity[t] = Along(p, t, trial);
      const Real power = contact.Rub(velocity);
      // Not: is inside. What is not finite will not settle, and must not look unsettled only beside
      // others.
      const Truth beyond = Contact::Length(contact.rubbed) >
                           kSlack * now.physics.world.contact.friction * contact.pressure;
      settled = settled & (beyond == 0) & ((power < 0) == 0);
    }
    return settled;
  }

 private:
  static constexpr size_t kRows =
      1 + Tree<Real>::kTangents;  // along the normal, and along the surface
  using Contact = plumb::Contact<Real, kRows>;
  using Truth = Mask<Real>;
  static constexpr bool kSlides = Contact::kSlides;

  const Real* Row(size_t point, size_t direction) const {
    return &rows_[(point * kRows + direction) * n_];
  }

  // Of a sliding contact.
  void AddAcross(const Substep& now, size_t p, Real* matrix, Real* rhs) {
    const Contact& contact = contacts_[p];
    if (!Any(contact.aside > 0)) return;
    const Real *one = Row(p, 1), *other = Row(p, kRows - 1);
    for (int i = contact.chain.last; i >= 0; i = contact.chain.before[i])
      across_[static_cast<size_t>(i)] =
          contact.across[1] * one[i] + contact.across[kRows - 1] * other[i];
    AddRow(now, p, across_.data(), Real{}, contact.aside, matrix, rhs);
  }

  // A contact of that depth, whose rows are there. True: it acts.
  bool Begin(const Substep& now, size_t p, const Real& depth, const Real* trial) {
    Contact& contact = contacts_[p];
    const Chain chain = contact.chain;
    contact = Contact{};
    contact.chain = chain;
    contact.near = true;
    contact.depth = depth;
    contact.active = depth - now.ahead * Along(p, 0, trial) > 0;
    contact.any = Any(contact.active);
    return contact.any;
  }

  bool FindLinks(const Substep& now, const Tree<Real>& tree, const Real* trial) {
    bool any = false;
    links_.Find(now.physics, tree);
    size_t spot = 0;
    for (const Topology::Pair& pair : topology_.pairs) {
      for (size_t k = 0; k < pair.spots; ++k, ++spot) {
        const size_t p = topology_.points.size() + spot;
        const typename LinkContacts<Real>::Spot& at = links_[spot];
        contacts_[p].any = contacts_[p].near = at.any;
        if (!at.any) continue;
        Real* rows = &rows_[p * kRows * n_];
        std::fill(rows, rows + kRows * n_, Real{});
        for (size_t t = 0; t < kRows; ++t) {
          Real* row = rows + t * n_;
          tree.AddRow(topology_.solids[pair.second].link, at.position, at.directions[t], 1, row);
          tree.AddRow(topology_.solids[pair.first].link, at.position, at.directions[t], -1, row);
        }
        any = Begin(now, p, Real{} - at.distance, trial) || any;
      }
    }
    return any;
  }

  Real Along(size_t point, size_t direction, const Real* velocity) const {
    return Dot(point, Row(point, direction), velocity);
  }
  Real Dot(size_t point, const Real* row, const Real* velocity) const {
    Real sum{};
    const Chain& chain = contacts_[point].chain;
    for (int i = chain.last; i >= 0; i = chain.before[i]) sum += row[i] * velocity[i];
    return sum;
  }

  // Of a contact's force in the velocity.
  Real Slope(const Substep& now) const {
    return now.physics.world.contact.stiffness * now.ahead + now.physics.world.contact.damping;
  }

  // force = at_rest - slope * row . (v + dv), acting along the row
  void AddForce(const Substep& now, size_t point, size_t direction, const Real& at_rest,
                const Real& slope, Real* matrix, Real* rhs) const {
    AddRow(now, point, Row(point, direction), at_rest, slope, matrix, rhs);
  }
  void AddRow(const Substep& now, size_t point, const Real* row, const Real& at_rest,
              const Real& slope, Real* matrix, Real* rhs) const {
    const Real force = now.h * (at_rest - slope * Dot(point, row, now.v));
    const Chain& chain = contacts_[point].chain;
    for (int i = chain.last; i >= 0; i = chain.before[i]) {
      const Real scaled = now.h * slope * row[i];
      rhs[i] += row[i] * force;
      Real* entries = matrix + static_cast<size_t>(i) * n_;
      for (int j = i; j >= 0; j = chain.before[j]) entries[j] += scaled * row[j];
    }
  }

  const Topology& topology_;
  size_t n_;
  std::vector<Real> shift_;                 // of the velocities, by friction
  JointConstraints<Real, kSlides> joints_;  // their stops and friction
  LinkContacts<Real> links_;
  std::vector<Contact> contacts_;  // of points with the ground, then of links with each other
  std::vector<Real> rows_;         // the contacts' Jacobians
  std::vector<Real> across_;       // a row of them, across the motion
};

}  // namespace plumb
