#pragma once

#include <vector>

#include "sim/dynamics/physics.h"
#include "sim/dynamics/topology.h"
#include "sim/dynamics/vector.h"

namespace plumb {

/// Equations of motion of a tree in space: as PlanarTree, in three dimensions. Not thread-safe. The
/// topology must outlive it.
template <class Real>
class SpatialTree {
 public:
  static constexpr int kTangents = 2;

  explicit SpatialTree(const Topology& topology)
      : topology_(topology),
        links_(topology.joints.size() + 1),
        columns_(static_cast<size_t>(topology.velocities)),
        composites_(links_.size()) {
    links_[0] = Link{};
    links_[0].rotation.x.x += 1;
    links_[0].rotation.y.y += 1;
    links_[0].rotation.z.z += 1;
  }

  void MoveTo(const Physics<Real>& physics, const Real* q) {
    for (size_t i = 0; i < topology_.joints.size(); ++i) {
      const Topology::Joint& joint = topology_.joints[i];
      const Link& parent = links_[static_cast<size_t>(joint.parent)];
      Link& link = links_[i + 1];
      link.offset = parent.rotation * Vector<Real>::From(physics.links[i].origin);
      Column* column = &columns_[static_cast<size_t>(joint.velocity)];
      const Real* position = q + joint.position;
      switch (joint.type) {
        case JointDescription::Type::kPrismatic:
          link.rotation = parent.rotation;
          column->linear = parent.rotation * Vector<Real>::From(joint.axis);
          column->angular = Vector<Real>{};
          link.offset += position[0] * column->linear;
          break;
        case JointDescription::Type::kSpherical: {
          link.rotation = parent.rotation * Turn(joint, position);
          for (int k = 0; k < 3; ++k) {
            column[k].angular =
                link.rotation * Vector<Real>::From(joint.link_axes + ptrdiff_t{3} * k);
          }
          break;
        }
        default:
          link.rotation = parent.rotation * Turn(joint.axis, position[0]);
          column->angular = parent.rotation * Vector<Real>::From(joint.axis);
      }
      link.position = parent.position + link.offset;
    }
    const Vector<Real> anchor = links_[static_cast<size_t>(topology_.anchor)].position;
    for (size_t i = 0; i < topology_.joints.size(); ++i) {
      const Topology::Joint& joint = topology_.joints[i];
      Link& link = links_[i + 1];
      const Vector<Real> origin = link.position - anchor;
      link.arm = link.rotation * Vector<Real>::From(physics.links[i].center);
      link.center = origin + link.arm;
      link.inertia = Turned(link.rotation, physics.links[i].inertia);
      if (!joint.turns()) continue;
      const size_t first = static_cast<size_t>(joint.velocity),
                   count = joint.type == JointDescription::Type::kSpherical ? 3 : 1;
      for (size_t k = first; k < first + count; ++k) {
        Column& column = columns_[k];
        column.linear = origin.Cross(column.angular);
      }
    }
  }

  void MoveAt(const Real* v) {
    for (size_t i = 0; i < topology_.joints.size(); ++i) {
      const Topology::Joint& joint = topology_.joints[i];
      const Link& parent = links_[static_cast<size_t>(joint.parent)];
      Link& link = links_[i + 1];
      const Column* column = &columns_[static_cast<size_t>(joint.velocity)];
      const Real* velocity = v + joint.velocity;
      link.linear_bias = parent.linear_bias + parent.angular_bias.Cross(link.offset) +
                         parent.spin.Cross(parent.spin.Cross(link.offset));
      link.spin = parent.spin;
      link.angular_bias = parent.angular_bias;
      if (!joint.turns()) {
        link.linear_bias += 2 * velocity[0] * parent.spin.Cross(column->linear);
        continue;
      }
      Vector<Real> relative = velocity[0] * column->angular;
      if (joint.type == JointDescription::Type::kSpherical) {
        relative += velocity[1] * column[1].angular;
        relative += velocity[2] * column[2].angular;
      }
      link.spin += relative;
      link.angular_bias += parent.spin.Cross(relative);
    }
  }

  void MassMatrix(const Physics<Real>& physics, Real* matrix) {
    const auto n = static_cast<size_t>(topology_.velocities);
    for (size_t i = 0; i < topology_.joints.size(); ++i) {
      const Link& link = links_[i + 1];
      Composite& own = composites_[i + 1];
      const Vector<Real>& c = link.center;
      own.mass = physics.links[i].mass;
      own.moment = own.mass * c;
      const Vector<Real>& m = own.moment;
      own.inertia = link.inertia;
      own.inertia +=
          Symmetric<Real>{m.y * c.y + m.z * c.z, m.x * c.x + m.z * c.z, m.x * c.x + m.y * c.y,
                          -(m.x * c.y),          -(m.x * c.z),          -(m.y * c.z)};
    }
    for (size_t j = topology_.joints.size(); j-- > 0;) {
      const Topology::Joint& joint = topology_.joints[j];
      const Composite& all = composites_[j + 1];
      const int count = joint.type == JointDescription::Type::kSpherical ? 3 : 1;
      for (int k = joint.velocity; k < joint.velocity + count; ++k) {
        const Column& moved = columns_[static_cast<size_t>(k)];
        Vector<Real> linear = all.mass * moved.linear, angular = all.moment.Cross(moved.linear);
        if (joint.turns()) {
          linear += moved.angular.Cross(all.moment);
          angular += all.inertia * moved.angular;
        }
        Real* row = matrix + static_cast<size_t>(k) * n;
        for (int i = k; i >= 0; i = topology_.ancestors[static_cast<size_t>(i)]) {
          const Column& column = columns_[static_cast<size_t>(i)];
          row[i] = column.angular.Dot(angular) + column.linear.Dot(linear);
        }
      }
      if (joint.parent > 0) {
        Composite& carrier = composites_[static_cast<size_t>(joint.parent)];
        carrier.mass += all.mass;
        carrier.moment += all.moment;
        carrier.inertia += all.inertia;
      }
    }
  }

  void Bias(const Physics<Real>& physics, Real* bias) {
    Vector<Real> gravity{};
    gravity.x += physics.world.gravity * topology_.up[0];
    gravity.y += physics.world.gravity * topology_.up[1];
    gravity.z += physics.world.gravity * topology_.up[2];
    for (size_t i = 0; i < topology_.joints.size(); ++i) {
      const Link& link = links_[i + 1];
      Composite& own = composites_[i + 1];
      own.force = physics.links[i].mass * (link.linear_bias + link.angular_bias.Cross(link.arm) +
                                           link.spin.Cross(link.spin.Cross(link.arm)) + gravity);
      own.moment = link.center.Cross(own.force) + link.inertia * link.angular_bias +
                   link.spin.Cross(link.inertia * link.spin);
    }
    for (size_t j = topology_.joints.size(); j-- > 0;) {
      const Topology::Joint& joint = topology_.joints[j];
      const Composite& all = composites_[j + 1];
      const int count = joint.type == JointDescription::Type::kSpherical ? 3 : 1;
      for (int k = joint.velocity; k < joint.velocity + count; ++k) {
        const Column& column = columns_[static_cast<size_t>(k)];
        bias[k] = column.angular.Dot(all.moment) + column.linear.Dot(all.force);
      }
      if (joint.parent > 0) {
        Composite& carrier = composites_[static_cast<size_t>(joint.parent)];
        carrier.force += all.force;
        carrier.moment += all.moment;
      }
    }
  }

  Real Height(const Physics<Real>& physics, size_t point) const {
    const Link& link = links_[static_cast<size_t>(topology_.points[point].link)];
    const auto& sphere = physics.points[point];
    return link.position.z + (link.rotation * Vector<Real>::From(sphere.position)).z -
           sphere.radius;
  }

  void Jacobian(const Physics<Real>& physics, size_t point, Real* rows) const {
    const auto n = static_cast<size_t>(topology_.velocities);
    const int carrier = topology_.points[point].link;
    const Link& link = links_[static_cast<size_t>(carrier)];
    const auto& sphere = physics.points[point];
    Vector<Real> spot = link.position - links_[static_cast<size_t>(topology_.anchor)].position +
                        link.rotation * Vector<Real>::From(sphere.position);
    spot.z -= sphere.radius;
    for (int i = topology_.LastVelocity(carrier); i >= 0;
         i = topology_.ancestors[static_cast<size_t>(i)]) {
      const auto at = static_cast<size_t>(i);
      const Vector<Real> velocity = columns_[at].linear + columns_[at].angular.Cross(spot);
      rows[at] = velocity.z;
      rows[n + at] = velocity.x;
      rows[2 * n + at] = velocity.y;
    }
  }

  /// A link's axes and origin [m], in the world.
  const Rotation<Real>& Turned(int link) const {
    return links_[static_cast<size_t>(link)].rotation;
  }
  const Vector<Real>& Origin(int link) const { return links_[static_cast<size_t>(link)].position; }

  /// Adds to a row of n what a spot's [m] velocity along a direction is, times `sign`, where it
  /// moves with a link.
  void AddRow(int link, const Vector<Real>& spot, const Vector<Real>& direction, double sign,
              Real* row) const {
    const Vector<Real> arm = spot - links_[static_cast<size_t>(topology_.anchor)].position;
    for (int i = topology_.LastVelocity(link); i >= 0;
         i = topology_.ancestors[static_cast<size_t>(i)]) {
      const auto at = static_cast<size_t>(i);
      const Vector<Real> velocity = columns_[at].linear + columns_[at].angular.Cross(arm);
      row[at] += sign * velocity.Dot(direction);
    }
  }

 private:
  struct Link {
    Rotation<Real> rotation;    // of working axes
    Vector<Real> offset;        // from the parent's origin to this one's
    Vector<Real> position;      // of the origin
    Vector<Real> arm;           // from the origin to the centre of mass
    Vector<Real> center;        // centre of mass, from the anchor
    Symmetric<Real> inertia;    // about the centre of mass
    Vector<Real> spin;          // [rad/s]
    Vector<Real> angular_bias;  // angular acceleration at zero joint accelerations
    Vector<Real> linear_bias;   // and that of the origin
  };
  struct Column {  // motion per unit of a joint velocity, as seen at the anchor
    Vector<Real> angular, linear;
  };
  struct Composite {  // of a link and all beyond it, about the anchor
    Real mass;
    Vector<Real> moment, force;  // first moment of mass, or moment of the force
    Symmetric<Real> inertia;
  };

  static Rotation<Real> Turn(const double* axis, const Real& angle) {
    Real s, c;
    SinCos(angle, &s, &c);
    const Real rest = 1 - c;
    const double x = axis[0], y = axis[1], z = axis[2];
    return {{c + x * x * rest, x * y * rest + z * s, x * z * rest - y * s},
            {x * y * rest - z * s, c + y * y * rest, y * z * rest + x * s},
            {x * z * rest + y * s, y * z * rest - x * s, c + z * z * rest}};
  }

  // A quaternion in link axes, seen in working axes. Its length does not matter.
  static Rotation<Real> Turn(const Topology::Joint& joint, const Real* quaternion) {
    const Real& w = quaternion[0];
    const Vector<Real> v = quaternion[1] * Vector<Real>::From(joint.link_axes) +
                           quaternion[2] * Vector<Real>::From(joint.link_axes + 3) +
                           quaternion[3] * Vector<Real>::From(joint.link_axes + 6);
    const Real two = 2 / (w * w + v.Dot(v));
    return {{1 - two * (v.y * v.y + v.z * v.z), two * (v.x * v.y + w * v.z),
             two * (v.x * v.z - w * v.y)},
            {two * (v.x * v.y - w * v.z), 1 - two * (v.x * v.x + v.z * v.z),
             two * (v.y * v.z + w * v.x)},
            {two * (v.x * v.z + w * v.y), two * (v.y * v.z - w * v.x),
             1 - two * (v.x * v.x + v.y * v.y)}};
  }

  // R I R^T
  static Symmetric<Real> Turned(const Rotation<Real>& r, const Real* i) {
    const Vector<Real> a = i[0] * r.x + i[3] * r.y + i[4] * r.z;
    const Vector<Real> b = i[3] * r.x + i[1] * r.y + i[5] * r.z;
    const Vector<Real> c = i[4] * r.x + i[5] * r.y + i[2] * r.z;
    return {a.x * r.x.x + b.x * r.y.x + c.x * r.z.x, a.y * r.x.y + b.y * r.y.y + c.y * r.z.y,
            a.z * r.x.z + b.z * r.y.z + c.z * r.z.z, a.x * r.x.y + b.x * r.y.y + c.x * r.z.y,
            a.x * r.x.z + b.x * r.y.z + c.x * r.z.z, a.y * r.x.z + b.y * r.y.z + c.y * r.z.z};
  }

  const Topology& topology_;
  std::vector<Link> links_;  // the base first
  std::vector<Column> columns_;
  std::vector<Composite> composites_;
};

}  // namespace plumb
