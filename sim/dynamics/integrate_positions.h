#pragma once

#include <cstddef>

#include "sim/dynamics/real.h"
#include "sim/dynamics/topology.h"

// What velocities that stay as they are make of positions. Real is double or a pack. Functions here
// are thread-safe.
namespace plumb {

/// A quaternion (w, x, y, z) times the exponential of half the angle turned: exact for constant
/// angular velocity in link axes.
/// @param spin [rad/s] three numbers. @param quaternion four, of length one if `spin` is not zero.
template <class Real>
void IntegrateQuaternion(const Real& h, const Real* spin, Real* quaternion) {
  const Real speed = Sqrt(Real(spin[0] * spin[0] + spin[1] * spin[1] + spin[2] * spin[2]));
  const Real half = 0.5 * h * speed;
  Real sine, cosine;
  SinCos(half, &sine, &cosine);
  const Mask<Real> moves = speed > 0;
  const Real share = moves ? Real(sine / (moves ? speed : Real{} + 1)) : Real{};
  const Real a = quaternion[0], b = quaternion[1], c = quaternion[2], d = quaternion[3];
  const Real x = share * spin[0], y = share * spin[1], z = share * spin[2];
  const Real w1 = a * cosine - b * x - c * y - d * z;
  const Real x1 = a * x + b * cosine + c * z - d * y;
  const Real y1 = a * y - b * z + c * cosine + d * x;
  const Real z1 = a * z + b * y - c * x + d * cosine;
  const Real length = Sqrt(Real(w1 * w1 + x1 * x1 + y1 * y1 + z1 * z1));
  // A lane that does not turn keeps its bits: it may be here for another lane's sake.
  quaternion[0] = moves ? Real(w1 / length) : a;
  quaternion[1] = moves ? Real(x1 / length) : b;
  quaternion[2] = moves ? Real(y1 / length) : c;
  quaternion[3] = moves ? Real(z1 / length) : d;
}

/// q += h velocity. @param h [s]. @param velocity one per velocity, q one per position.
template <class Real>
void IntegratePositions(const Topology& topology, const Real& h, const Real* velocity, Real* q) {
  if (topology.positions == topology.velocities) {
    const auto n = static_cast<size_t>(topology.velocities);
    for (size_t i = 0; i < n; ++i) q[i] += h * velocity[i];
    return;
  }
  for (const Topology::Joint& joint : topology.joints) {
    Real* position = &q[static_cast<size_t>(joint.position)];
    const Real* speed = velocity + joint.velocity;
    if (joint.type == JointDescription::Type::kSpherical) {
      IntegrateQuaternion(h, speed, position);
    } else {
      position[0] += h * speed[0];
    }
  }
}

}  // namespace plumb
