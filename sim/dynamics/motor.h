#pragma once

#include "robot/parameter_kinds.h"
#include "sim/dynamics/real.h"

// What a joint's motor and gear make of an effort [Nm or N]. Real is double or a pack. Thread-safe.
namespace plumb {

/// An effort along the speed is limited by it, see JointDynamics::no_load_speed.
/// @param limit of the joint's effort, > 0.
template <class Real>
Real SlowedEffort(const JointDynamicsOf<Real>& joint, const Real& effort, const Real& speed,
                  double limit) {
  const Real inverse_no_load_speed = 1 / joint.no_load_speed;
  const Real share = speed * inverse_no_load_speed;
  const Real forwards = limit * Max(Real(1 - share), Real{}),
             backwards = limit * Max(Real(1 + share), Real{});
  return Clamp(effort, Real(-backwards), forwards);
}

/// An effort f that drives arrives as e f, one that brakes as f (efficiency that depends on the
/// direction: Wang, Kim, ICRA 2015). That is f - l with Coulomb friction of |l| against the motion,
/// l = (1 - e)/2 f: so the jump where the motion turns is settled with friction, implicitly, and a
/// joint may hold still under a load that its motor can hold but not lift. @return l.
template <class Real>
Real GearLoss(const JointDynamicsOf<Real>& joint, const Real& effort) {
  return 0.5 * (1 - joint.gear_efficiency) * effort;
}

}  // namespace plumb
