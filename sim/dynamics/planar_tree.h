#pragma once

#include <vector>

#include "sim/dynamics/physics.h"
#include "sim/dynamics/topology.h"

namespace plumb {

/// Equations of motion of a tree whose joints all move in one plane: composite rigid bodies for the
/// mass matrix, recursive Newton-Euler for the bias (Featherstone, "Rigid Body Dynamics
/// Algorithms", 2008, sections 6.2 and 5.3) with three-dimensional instead of six-dimensional
/// vectors, all in working axes about the anchor. Not thread-safe. The topology must outlive it.
template <class Real>
class PlanarTree {
 public:
  static constexpr int kTangents = 1;

  explicit PlanarTree(const Topology& topology)
      : topology_(topology), links_(topology.joints.size() + 1), composites_(links_.size()) {
    links_[0] = Link{};  // the base: at rest
    links_[0].cosine += 1;
  }

  /// Poses at q. First of all.
  void MoveTo(const Physics<Real>& physics, const Real* q) {
    for (size_t i = 0; i < topology_.joints.size(); ++i) {
      const Topology::Joint& joint = topology_.joints[i];
      const Link& parent = links_[static_cast<size_t>(joint.parent)];
      Link& link = links_[i + 1];
      const Real* origin = physics.links[i].origin;
      link.rx = parent.cosine * origin[0] - parent.sine * origin[1];
      link.ry = parent.sine * origin[0] + parent.cosine * origin[1];
      if (joint.turns()) {
        link.angle = parent.angle + joint.axis[2] * q[i];
        SinCos(link.angle, &link.sine, &link.cosine);
      } else {
        link.angle = parent.angle, link.sine = parent.sine, link.cosine = parent.cosine;
        link.lx = parent.cosine * joint.axis[0] - parent.sine * joint.axis[1];
        link.ly = parent.sine * joint.axis[0] + parent.cosine * joint.axis[1];
        link.rx += link.lx * q[i];
        link.ry += link.ly * q[i];
      }
      link.x = parent.x + link.rx;
      link.y = parent.y + link.ry;
    }
    const Real anchor_x = links_[static_cast<size_t>(topology_.anchor)].x,
               anchor_y = links_[static_cast<size_t>(topology_.anchor)].y;
    for (size_t i = 0; i < topology_.joints.size(); ++i) {
      const Topology::Joint& joint = topology_.joints[i];
      Link& link = links_[i + 1];
      const Real* center = physics.links[i].center;
      const Real x = link.x - anchor_x, y = link.y - anchor_y;
      link.ax = link.cosine * center[0] - link.sine * center[1];
      link.ay = link.sine * center[0] + link.cosine * center[1];
      link.cx = x + link.ax;
      link.cy = y + link.ay;
      if (joint.turns()) link.lx = joint.axis[2] * y, link.ly = -joint.axis[2] * x;
    }
  }

  /// Velocities, and accelerations at zero joint accelerations, at the q of MoveTo.
  void MoveAt(const Real* v) {
    for (size_t i = 0; i < topology_.joints.size(); ++i) {
      const Topology::Joint& joint = topology_.joints[i];
      const Link& parent = links_[static_cast<size_t>(joint.parent)];
      Link& link = links_[i + 1];
      const Real squared = parent.spin * parent.spin;
      link.bx = parent.bx - squared * link.rx;
      link.by = parent.by - squared * link.ry;
      if (joint.turns()) {
        link.spin = parent.spin + joint.axis[2] * v[i];
      } else {
        link.spin = parent.spin;
        const Real twice = 2 * parent.spin * v[i];
        link.bx -= twice * link.ly;
        link.by += twice * link.lx;
      }
    }
  }

  /// Lower triangle, row by row, without armature. Entries that are always zero are not written.
  void MassMatrix(const Physics<Real>& physics, Real* matrix) {
    const size_t n = topology_.joints.size();
    for (size_t i = 0; i < n; ++i) {
      const Link& link = links_[i + 1];
      const Real mass = physics.links[i].mass;
      Composite& own = composites_[i + 1];
      own.mass = mass;
      own.x = mass * link.cx;
      own.y = mass * link.cy;
      own.inertia = physics.links[i].inertia[2] + (own.x * link.cx + own.y * link.cy);
    }
    for (size_t j = n; j-- > 0;) {
      const Link& moved = links_[j + 1];
      const Composite& all = composites_[j + 1];
      const int parent = topology_.joints[j].parent;
      // Momentum of everything beyond joint j when it moves with unit velocity.
      Real px = all.mass * moved.lx, py = all.mass * moved.ly,
           spin = all.x * moved.ly - all.y * moved.lx;
      if (topology_.joints[j].turns()) {
        const double axis = topology_.joints[j].axis[2];
        px -= axis * all.y;
        py += axis * all.x;
        spin += axis * all.inertia;
      }
      Real* row = matrix + j * n;
      for (int i = static_cast<int>(j); i >= 0;
           i = topology_.joints[static_cast<size_t>(i)].parent - 1) {
        const Link& ancestor = links_[static_cast<size_t>(i) + 1];
        const Topology::Joint& joint = topology_.joints[static_cast<size_t>(i)];
        row[i] = ancestor.lx * px + ancestor.ly * py;
        if (joint.turns()) row[i] += joint.axis[2] * spin;
      }
      if (parent > 0) {
        Composite& carrier = composites_[static_cast<size_t>(parent)];
        carrier.mass += all.mass;
        carrier.x += all.x;
        carrier.y += all.y;
        carrier.inertia += all.inertia;
      }
    }
  }

  /// Efforts that hold zero joint accelerations against gravity and inertia, at the velocities of
  /// MoveAt.
  void Bias(const Physics<Real>& physics, Real* bias) {
    const size_t n = topology_.joints.size();
    const Real gx = physics.world.gravity * topology_.up[0],
               gy = physics.world.gravity * topology_.up[1];
    for (size_t i = 0; i < n; ++i) {
      const Link& link = links_[i + 1];
      const Real mass = physics.links[i].mass, squared = link.spin * link.spin;
      Composite& own = composites_[i + 1];
      own.x = mass * (link.bx - squared * link.ax + gx);  // force and its moment, here
      own.y = mass * (link.by - squared * link.ay + gy);
      own.inertia = link.cx * own.y - link.cy * own.x;
    }
    for (size_t j = n; j-- > 0;) {
      const Topology::Joint& joint = topology_.joints[j];
      const Composite& all = composites_[j + 1];
      bias[j] = links_[j + 1].lx * all.x + links_[j + 1].ly * all.y;
      if (joint.turns()) bias[j] += joint.axis[2] * all.inertia;
      if (joint.parent > 0) {
        Composite& carrier = composites_[static_cast<size_t>(joint.parent)];
        carrier.x += all.x;
        carrier.y += all.y;
        carrier.inertia += all.inertia;
      }
    }
  }

  /// Height of a point's lowest spot above the ground.
  Real Height(const Physics<Real>& physics, size_t point) const {
    const Link& link = links_[static_cast<size_t>(topology_.points[point].link)];
    const auto& sphere = physics.points[point];
    return link.y + (link.sine * sphere.position[0] + link.cosine * sphere.position[1]) -
           sphere.radius;
  }

  /// Jacobian of that spot: rows of n, upwards and along the ground. Writes only the joints that
  /// carry the point.
  void Jacobian(const Physics<Real>& physics, size_t point, Real* rows) const {
    const size_t n = topology_.joints.size();
    const int carrier = topology_.points[point].link;
    const Link& link = links_[static_cast<size_t>(carrier)];
    const Link& anchor = links_[static_cast<size_t>(topology_.anchor)];
    const auto& sphere = physics.points[point];
    const Real x =
        link.x - anchor.x + (link.cosine * sphere.position[0] - link.sine * sphere.position[1]);
    const Real y = link.y - anchor.y +
                   (link.sine * sphere.position[0] + link.cosine * sphere.position[1]) -
                   sphere.radius;
    for (int i = carrier - 1; i >= 0; i = topology_.joints[static_cast<size_t>(i)].parent - 1) {
      const auto at = static_cast<size_t>(i);
      const Topology::Joint& joint = topology_.joints[at];
      rows[at] = links_[at + 1].ly;
      rows[n + at] = links_[at + 1].lx;
      if (joint.turns()) {
        rows[at] += joint.axis[2] * x;
        rows[n + at] -= joint.axis[2] * y;
      }
    }
  }

 private:
  struct Link {
    Real angle, sine, cosine;
    Real rx, ry;  // from the parent's origin to this one's
    Real x, y;    // of the origin
    Real ax, ay;  // from the origin to the centre of mass
    Real cx, cy;  // centre of mass, from the anchor
    Real lx, ly;  // velocity at the anchor per unit of joint velocity
    Real spin;    // [rad/s]
    Real bx, by;  // acceleration of the origin at zero joint accelerations
  };
  struct Composite {  // of a link and all beyond it, about the anchor
    Real mass, x, y, inertia;
  };

  const Topology& topology_;
  std::vector<Link> links_;  // the base first
  std::vector<Composite> composites_;
};

}  // namespace plumb
