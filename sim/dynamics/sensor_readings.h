#pragma once

#include <cstddef>

#include "sim/dynamics/physics.h"
#include "sim/dynamics/topology.h"

// What joints' sensors make of their positions and velocities, and back: sensor_bias and
// sensor_delay of JointDynamics, to second order in the delay. Spherical joints have none. Arrays:
// q one per position, v and acceleration one per velocity. Real is double or a pack. Functions here
// are thread-safe.
namespace plumb {

/// Calls change(position, velocity, axis, i) for each joint that has a sensor of its own, i being
/// the index of its velocity and axis its JointDynamicsOf.
template <class Real, class Change>
void ForEachReading(const Topology& topology, const Physics<Real>& physics, Real* q, Real* v,
                    Change change) {
  for (const Topology::Joint& joint : topology.joints) {
    if (joint.type == JointDescription::Type::kSpherical) continue;
    const auto i = static_cast<size_t>(joint.velocity);
    change(q[static_cast<size_t>(joint.position)], v[i], physics.axes[i], i);
  }
}

/// Readings become those of sensors without a bias.
template <class Real>
void RemoveSensorBias(const Topology& topology, const Physics<Real>& physics, Real* q, Real* v) {
  ForEachReading(topology, physics, q, v, [&](Real& position, Real&, const auto& axis, size_t) {
    position -= axis.sensor_bias;
  });
}

/// Readings without a bias become the state of the moment at which they are read.
template <class Real>
void RemoveSensorDelay(const Topology& topology, const Physics<Real>& physics,
                       const Real* acceleration, Real* q, Real* v) {
  ForEachReading(topology, physics, q, v,
                 [&](Real& position, Real& velocity, const auto& axis, size_t i) {
                   const Real t = axis.sensor_delay;
                   position += t * velocity + 0.5 * t * t * acceleration[i];
                   velocity += t * acceleration[i];
                 });
}

/// The state becomes what is read at its moment.
template <class Real>
void AddSensorErrors(const Topology& topology, const Physics<Real>& physics,
                     const Real* acceleration, Real* q, Real* v) {
  ForEachReading(topology, physics, q, v,
                 [&](Real& position, Real& velocity, const auto& axis, size_t i) {
                   const Real t = axis.sensor_delay;
                   position += axis.sensor_bias - t * velocity + 0.5 * t * t * acceleration[i];
                   velocity -= t * acceleration[i];
                 });
}

}  // namespace plumb
