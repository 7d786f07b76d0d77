#pragma once

#include <ode/ode.h>

#include <type_traits>

#include "robot/joints.h"
#include "robot/kinematics.h"
#include "sim/virtual/ode_backend.h"

namespace plumb {

static_assert(std::is_same_v<dReal, double>);

/// A cushion as ODE has it: the share of its depth that a step takes out, and the speed that a unit
/// of force is let have. ODE's manual, "How to use ERP and CFM".
struct OdeSoftness {
  OdeSoftness(const Cushion& cushion, double step);
  double cfm, erp;
};

/// One of the robot's joints by what it takes of ODE's between the same two bodies. Not
/// thread-safe.
class OdeJoint {
 public:
  /// @param zero where the link is while the joint is at 0, which its and its parent's bodies are.
  /// @param parent null: the world. @param stops whether it ends at its position limits.
  /// @throws std::invalid_argument if its stops are more than half a turn away.
  OdeJoint(const JointDescription& joint, dWorldID world, const Pose& zero, dBodyID link,
           dBodyID parent, bool stops);

  /// For the next step, of `step` seconds. @param effort [Nm or N] of the motor. @param q, v of the
  /// joint.
  void Prepare(double effort, double q, double v, double step) const;

  /// [rad or m] @param near where it was, not half a turn away.
  double Position(double near) const;
  double Velocity() const;  ///< [rad/s or m/s]

 private:
  dJointID Motor(dWorldID world, const Eigen::Vector3d& axis) const;

  bool slides_, stops_;
  JointDynamics dynamics_;
  double effort_limit_;
  dBodyID link_, parent_;
  dJointID guide_;               // hinge or slider, and its stops
  dJointID yielding_ = nullptr;  // armature, damping and spring, if there are any
};

}  // namespace plumb
