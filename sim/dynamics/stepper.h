#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "sim/dynamics/physics.h"
#include "sim/dynamics/sparse_cholesky.h"
#include "sim/dynamics/topology.h"

namespace plumb {

/// Which terms of the equations a robot has at all: what is false costs nothing.
struct Terms {
  bool springs = false, friction = false, slowing = false, stops = false, sensors = false;
};

/// Integrates a robot over substeps of given length, with joint damping, springs, friction, stops and contacts taken
/// at the end of the substep and linearised in the velocity there ("linearly implicit"), so that stiff ones need no
/// shorter substeps:
///   (M + h D + ...) dv = h (effort - bias - D v + ...)
/// Whether a stop or contact pushes, and how friction divides by the speed (Coulomb's force is mu f_n v / |v|, viscous
/// below a small speed), is settled by fixed-point iteration: once with the free motion, kPasses times with the
/// outcome before. Not thread-safe. The topology must outlive it.
///
/// Real is double or a pack. Every lane has the bits it would have alone.
template <class Real, template <class> class Tree>
class Stepper {
 public:
  static constexpr int kPasses = 2;
  static constexpr double kStickSpeed = 0.01;  ///< [rad/s] or [m/s] below which joint friction is viscous

  Stepper(const Topology& topology, const SimulationSettings& settings, const Terms& terms)
      : topology_(topology),
        settings_(settings),
        terms_(terms),
        leapfrog_(settings.integrator == SimulationSettings::Integrator::kLeapfrog),
        n_(static_cast<size_t>(topology.velocities)),
        tree_(topology),
        q(static_cast<size_t>(topology.positions)),
        v(n_),
        smooth_(n_ * n_),
        matrix_(smooth_),
        drive_(n_),
        bias_(n_),
        rhs_(n_),
        change_(n_),
        trial_(n_),
        shift_(n_),
        rubbed_(n_),
        outcome_(n_),
        contacts_(topology.points.size()),
        rows_(topology.points.size() * kRows * n_),
        cholesky_(n_) {}

  /// One substep of h > 0 seconds, which may differ from lane to lane. Arrays of one per velocity:
  /// @param effort mean over the substep of what is commanded.
  /// @param moment integral over the substep of (h/2 - t) effort(t) dt, or null where effort is constant: it moves
  /// the joints as an effort early in the substep moves them farther than a late one. [Nm s^2]
  void Substep(const Real& h, const Real* effort, const Real* moment) {
    if (leapfrog_) Move(Real(h / 2), v.data());
    tree_.MoveTo(physics, q.data());
    AssembleSmooth(h, effort);
    matrix_ = smooth_;
    cholesky_.Factorize(topology_.ancestors, matrix_.data());
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
    if (FindConstraints(h)) {
      for (int pass = 0; pass < kPasses; ++pass) {
        Foresee(h);
        AssembleConstraints(h);
        cholesky_.Factorize(topology_.ancestors, matrix_.data());
        cholesky_.Solve(topology_.ancestors, matrix_.data(), change_.data());
        Judge(h);
      }
    }
    for (size_t i = 0; i < n_; ++i) v[i] += change_[i];
    if (!settings_.move_before_clip) Clip();
    Move(Ahead(h), v.data());
    if (moment) {
      for (size_t i = 0; i < n_; ++i) shift_[i] = physics.axes[i].gain * moment[i];
      cholesky_.Solve(topology_.ancestors, matrix_.data(), shift_.data());
      Move(Real{} + 1, shift_.data());
    }
    if (settings_.move_before_clip) Clip();
  }

  /// Accelerations at q, v without stops, contacts and Coulomb friction: one per velocity.
  const Real* Acceleration(const Real* effort) {
    tree_.MoveTo(physics, q.data());
    AssembleSmooth(Real{}, effort);
    matrix_ = smooth_;
    cholesky_.Factorize(topology_.ancestors, matrix_.data());
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

  /// q, v are readings of sensors (JointDynamics): makes them the state that these are of, to second order in the
  /// delay, and back.
  void FromReading(const Real* effort) {
    const Real* acceleration = Acceleration(effort);
    ForEachReading([&](Real& position, Real& velocity, const auto& axis, size_t i) {
      const Real t = axis.sensor_delay;
      position += -axis.sensor_bias + t * velocity + 0.5 * t * t * acceleration[i];
      velocity += t * acceleration[i];
    });
  }
  void ToReading(const Real* effort) {
    const Real* acceleration = Acceleration(effort);
    ForEachReading([&](Real& position, Real& velocity, const auto& axis, size_t i) {
      const Real t = axis.sensor_delay;
      position += axis.sensor_bias - t * velocity + 0.5 * t * t * acceleration[i];
      velocity -= t * acceleration[i];
    });
  }

 private:
  static constexpr size_t kRows = 1 + Tree<Real>::kTangents;
  using Truth = Mask<Real>;

  struct Contact {
    Truth active;
    Real depth;     // where forces are evaluated
    Real pressure;  // normal force of the latest trial
    Real speed;     // along the ground, then
    Real along[kRows];  // and which way: of length one, behind an unused entry
    Real gripped;   // force of friction in that trial
    Real outcome;   // speed that friction will leave
    bool any;
  };

  const Topology& topology_;
  SimulationSettings settings_;
  Terms terms_;
  bool leapfrog_;
  size_t n_;
  Tree<Real> tree_;

 public:
  // What a step starts from and ends with; sizes are fixed.
  Physics<Real> physics;
  std::vector<Real> q, v;

 private:
  // One substep's work space.
  std::vector<Real> smooth_;  // matrix without stops, contacts and friction
  std::vector<Real> matrix_;  // with them; then its factors
  std::vector<Real> drive_;   // forces without them
  std::vector<Real> bias_, rhs_, change_, trial_, shift_;
  std::vector<Real> rubbed_, outcome_;  // joint friction per speed in the latest trial; speed that it will leave
  std::vector<Contact> contacts_;
  std::vector<Real> rows_;  // Jacobians of the contacts
  SparseCholesky<Real> cholesky_;

  // A torque along the speed is limited by it: see JointDynamics::no_load_speed.
  Real Slowed(size_t i, const Real& effort, const Real& speed, double limit) const {
    const Real share = speed * physics.axes[i].slowing;
    const Real forwards = limit * Max(Real(1 - share), Real{}), backwards = limit * Max(Real(1 + share), Real{});
    return Clamp(effort, Real(-backwards), forwards);
  }

  void AssembleSmooth(const Real& h, const Real* effort) {
    tree_.MoveAt(v.data());
    tree_.MassMatrix(physics, smooth_.data());
    tree_.Bias(physics, bias_.data());
    const double share = leapfrog_ ? 0.5 : 1;  // of the substep's end in the velocity that damping sees
    for (size_t i = 0; i < n_; ++i) {
      const auto& axis = physics.axes[i];
      drive_[i] = axis.gain * effort[i] - bias_[i] - axis.damping * v[i];
      smooth_[i * n_ + i] += axis.armature + share * h * axis.damping;
    }
    if (terms_.slowing || terms_.springs) AssembleJoints(h, effort);
  }

  void AssembleJoints(const Real& h, const Real* effort) {
    for (const Topology::Joint& joint : topology_.joints) {
      if (joint.type == JointDescription::Type::kSpherical) continue;
      const auto i = static_cast<size_t>(joint.velocity);
      const auto& axis = physics.axes[i];
      if (terms_.slowing && joint.effort_limit > 0) {
        drive_[i] += axis.gain * (Slowed(i, effort[i], v[i], joint.effort_limit) - effort[i]);
      }
      if (terms_.springs) {
        // At the end of the substep; for the leapfrog at the mean of both ends (implicit midpoint).
        const Real stretch = q[static_cast<size_t>(joint.position)] - axis.rest;
        drive_[i] -= axis.stiffness * (leapfrog_ ? stretch : Real(stretch + h * v[i]));
        smooth_[i * n_ + i] += (leapfrog_ ? 0.25 : 1.0) * h * h * axis.stiffness;
      }
    }
  }

  void Solve(const Real& h) {
    for (size_t i = 0; i < n_; ++i) change_[i] = h * drive_[i];
    cholesky_.Solve(topology_.ancestors, matrix_.data(), change_.data());
  }

  Real Ahead(const Real& h) const { return leapfrog_ ? Real(h / 2) : h; }  // to the substep's end, from where q is

  // Joint positions beyond a limit are so by this much; the sign says which way it pushes.
  void StopDepth(const Topology::Joint& joint, Real* depth, Real* sign) const {
    const Real& position = q[static_cast<size_t>(joint.position)];
    const Real below = joint.lower - position, above = position - joint.upper;
    const Truth low = below > above;
    *depth = low ? below : above;
    *sign = low ? Real{} + 1 : Real{} - 1;
  }

  bool HasStop(const Topology::Joint& joint) const {
    return terms_.stops && joint.upper < std::numeric_limits<double>::infinity() &&
           joint.type != JointDescription::Type::kSpherical;
  }

  // Looks with the free motion which constraints act. False: none does.
  bool FindConstraints(const Real& h) {
    bool any = terms_.friction;
    std::fill(rubbed_.begin(), rubbed_.end(), Real{});
    for (size_t i = 0; i < n_; ++i) trial_[i] = v[i] + change_[i];
    for (const Topology::Joint& joint : topology_.joints) {
      if (any || !HasStop(joint)) continue;
      Real depth, sign;
      StopDepth(joint, &depth, &sign);
      any = Any(depth - Ahead(h) * sign * trial_[static_cast<size_t>(joint.velocity)] > 0);
    }
    for (size_t p = 0; p < contacts_.size(); ++p) {
      Contact& contact = contacts_[p];
      contact.depth = -tree_.Height(physics, p);
      Real* rows = &rows_[p * kRows * n_];
      tree_.Jacobian(physics, p, rows);
      contact.pressure = Real{};
      contact.speed = Real{};
      contact.gripped = Real{};
      std::fill(contact.along, contact.along + kRows, Real{});
      contact.active = contact.depth - Ahead(h) * Along(p, rows, trial_.data()) > 0;
      contact.any = Any(contact.active);
      any = any || contact.any;
    }
    return any;
  }

  Real Along(size_t point, const Real* row, const Real* velocity) const {
    Real sum{};
    for (int i = Last(point); i >= 0; i = topology_.ancestors[static_cast<size_t>(i)]) sum += row[i] * velocity[i];
    return sum;
  }

  int Last(size_t point) const {
    const int link = topology_.points[point].link;
    if (link == 0) return -1;
    const Topology::Joint& joint = topology_.joints[static_cast<size_t>(link - 1)];
    return joint.velocity + (joint.type == JointDescription::Type::kSpherical ? 2 : 0);
  }

  // force = at_rest - slope * row . (v + dv), acting along the row
  void AddForce(const Real& h, size_t point, const Real* row, const Real& at_rest, const Real& slope) {
    const Real now = h * (at_rest - slope * Along(point, row, v.data()));
    for (int i = Last(point); i >= 0; i = topology_.ancestors[static_cast<size_t>(i)]) {
      const auto at = static_cast<size_t>(i);
      change_[at] += row[at] * now;
      const Real scaled = h * slope * row[at];
      for (int j = i; j >= 0; j = topology_.ancestors[static_cast<size_t>(j)]) {
        matrix_[at * n_ + static_cast<size_t>(j)] += scaled * row[j];
      }
    }
  }

  // Friction divides by the speed that it will leave, so that what slides slows evenly and what sticks sticks at once:
  // the trial's, changed by what friction at its full force takes beyond what it took in the trial.
  void Foresee(const Real& h) {
    const Real stick = Real{} + kStickSpeed;
    std::fill(shift_.begin(), shift_.end(), Real{});
    if (terms_.friction) {
      for (const Topology::Joint& joint : topology_.joints) {
        if (joint.type == JointDescription::Type::kSpherical) continue;
        const auto i = static_cast<size_t>(joint.velocity);
        const Real full = trial_[i] < 0 ? Real(-physics.axes[i].friction) : physics.axes[i].friction;
        shift_[i] = h * (full - rubbed_[i] * trial_[i]);
      }
    }
    for (size_t p = 0; p < contacts_.size(); ++p) {
      const Contact& contact = contacts_[p];
      if (!contact.any) continue;
      const Real more = physics.globals.contact_friction * contact.pressure - contact.gripped;
      for (size_t t = 1; t < kRows; ++t) {
        const Real force = contact.active ? Real(h * more * contact.along[t]) : Real{};
        const Real* row = &rows_[(p * kRows + t) * n_];
        for (int i = Last(p); i >= 0; i = topology_.ancestors[static_cast<size_t>(i)]) shift_[static_cast<size_t>(i)] += row[i] * force;
      }
    }
    cholesky_.Solve(topology_.ancestors, matrix_.data(), shift_.data());
    if (terms_.friction) {
      for (size_t i = 0; i < n_; ++i) {
        const Real taken = trial_[i] < 0 ? Real(-shift_[i]) : shift_[i];
        outcome_[i] = Max(Real(Abs(trial_[i]) - taken), stick);
      }
    }
    for (size_t p = 0; p < contacts_.size(); ++p) {
      Contact& contact = contacts_[p];
      if (!contact.any) continue;
      Real taken{};
      for (size_t t = 1; t < kRows; ++t) taken += contact.along[t] * Along(p, &rows_[(p * kRows + t) * n_], shift_.data());
      contact.outcome = Max(Real(contact.speed - taken), Real{} + settings_.contact->slip_speed);
    }
  }

  void AssembleConstraints(const Real& h) {
    matrix_ = smooth_;
    for (size_t i = 0; i < n_; ++i) change_[i] = h * drive_[i];
    const auto& globals = physics.globals;
    for (const Topology::Joint& joint : topology_.joints) {
      if (joint.type == JointDescription::Type::kSpherical) continue;
      const auto i = static_cast<size_t>(joint.velocity);
      if (terms_.friction) {
        const Real slope = physics.axes[i].friction / outcome_[i];
        rubbed_[i] = slope;
        matrix_[i * n_ + i] += h * slope;
        change_[i] -= h * slope * v[i];
      }
      if (HasStop(joint)) {
        Real depth, sign;
        StopDepth(joint, &depth, &sign);
        const Real slope = globals.stop_stiffness * Ahead(h) + globals.stop_damping;
        const Real force = globals.stop_stiffness * depth - slope * sign * trial_[i];
        const Truth acts = (depth - Ahead(h) * sign * trial_[i] > 0) & (force > 0);
        matrix_[i * n_ + i] += acts ? h * slope : Real{};
        change_[i] += acts ? h * (sign * globals.stop_stiffness * depth - slope * v[i]) : Real{};
      }
    }
    for (size_t p = 0; p < contacts_.size(); ++p) {
      Contact& contact = contacts_[p];
      if (!contact.any) continue;
      const Real* rows = &rows_[p * kRows * n_];
      const Real slope = globals.contact_stiffness * Ahead(h) + globals.contact_damping;
      AddForce(h, p, rows, contact.active ? globals.contact_stiffness * contact.depth : Real{},
               contact.active ? slope : Real{});
      const Real grip = globals.contact_friction * contact.pressure / contact.outcome;
      contact.gripped = grip;
      for (size_t t = 1; t < kRows; ++t) AddForce(h, p, rows + t * n_, Real{}, contact.active ? grip : Real{});
    }
  }

  // What the trial made of the constraints: the next one starts from there.
  void Judge(const Real& h) {
    for (size_t i = 0; i < n_; ++i) trial_[i] = v[i] + change_[i];
    const auto& globals = physics.globals;
    for (size_t p = 0; p < contacts_.size(); ++p) {
      Contact& contact = contacts_[p];
      if (!contact.any) continue;
      const Real* rows = &rows_[p * kRows * n_];
      const Real slope = globals.contact_stiffness * Ahead(h) + globals.contact_damping;
      const Real force = globals.contact_stiffness * contact.depth - slope * Along(p, rows, trial_.data());
      contact.active = contact.active & (force > 0);
      contact.pressure = Max(force, Real{});
      Real squared{};
      for (size_t t = 1; t < kRows; ++t) {
        contact.along[t] = Along(p, rows + t * n_, trial_.data());
        squared += contact.along[t] * contact.along[t];
      }
      contact.speed = Sqrt(squared);
      for (size_t t = 1; t < kRows; ++t) contact.along[t] = contact.speed > 0 ? Real(contact.along[t] / contact.speed) : Real{};
      contact.gripped = contact.active ? Real(contact.gripped * contact.speed) : Real{};
    }
  }

  void Clip() {
    if (!(settings_.speed_clip < std::numeric_limits<double>::infinity())) return;
    for (Real& speed : v) speed = Clamp(speed, Real{} - settings_.speed_clip, Real{} + settings_.speed_clip);
  }

  // q += h velocity
  void Move(const Real& h, const Real* velocity) {
    if (topology_.positions == topology_.velocities) {
      for (size_t i = 0; i < n_; ++i) q[i] += h * velocity[i];
      return;
    }
    for (const Topology::Joint& joint : topology_.joints) {
      Real* position = &q[static_cast<size_t>(joint.position)];
      const Real* speed = velocity + joint.velocity;
      if (joint.type == JointDescription::Type::kSpherical) {
        Turn(h, speed, position);
      } else {
        position[0] += h * speed[0];
      }
    }
  }

  // Quaternion times the exponential of half the angle turned: exact for constant angular velocity in link axes.
  static void Turn(const Real& h, const Real* spin, Real* quaternion) {
    const Real speed = Sqrt(Real(spin[0] * spin[0] + spin[1] * spin[1] + spin[2] * spin[2]));
    const Real half = 0.5 * h * speed;
    Real sine, cosine;
    SinCos(half, &sine, &cosine);
    const Truth moves = speed > 0;
    const Real share = moves ? Real(sine / (moves ? speed : Real{} + 1)) : Real{};
    const Real a = quaternion[0], b = quaternion[1], c = quaternion[2], d = quaternion[3];
    const Real x = share * spin[0], y = share * spin[1], z = share * spin[2];
    const Real w1 = a * cosine - b * x - c * y - d * z;
    const Real x1 = a * x + b * cosine + c * z - d * y;
    const Real y1 = a * y - b * z + c * cosine + d * x;
    const Real z1 = a * z + b * y - c * x + d * cosine;
    const Real length = Sqrt(Real(w1 * w1 + x1 * x1 + y1 * y1 + z1 * z1));
    // What does not turn keeps its bits: another lane may have made us look.
    quaternion[0] = moves ? Real(w1 / length) : a;
    quaternion[1] = moves ? Real(x1 / length) : b;
    quaternion[2] = moves ? Real(y1 / length) : c;
    quaternion[3] = moves ? Real(z1 / length) : d;
  }

  template <class Change>
  void ForEachReading(Change change) {
    for (const Topology::Joint& joint : topology_.joints) {
      if (joint.type == JointDescription::Type::kSpherical) continue;
      const auto i = static_cast<size_t>(joint.velocity);
      change(q[static_cast<size_t>(joint.position)], v[i], physics.axes[i], i);
    }
  }
};

}  // namespace plumb
