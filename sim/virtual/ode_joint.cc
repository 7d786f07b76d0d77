#include "sim/virtual/ode_joint.h"

#include <cmath>
#include <numbers>
#include <stdexcept>

#include "robot/drive_effort.h"

namespace plumb {
namespace {

void Set(dJointID joint, int parameter, double value) {
  switch (dJointGetType(joint)) {
    case dJointTypeHinge:
      return dJointSetHingeParam(joint, parameter, value);
    case dJointTypeSlider:
      return dJointSetSliderParam(joint, parameter, value);
    case dJointTypeAMotor:
      return dJointSetAMotorParam(joint, parameter, value);
    default:
      return dJointSetLMotorParam(joint, parameter, value);
  }
}

}  // namespace

OdeSoftness::OdeSoftness(const Cushion& cushion, double step)
    : cfm(1 / (step * cushion.stiffness + cushion.damping)), erp(step * cushion.stiffness * cfm) {}

OdeJoint::OdeJoint(const JointDescription& joint, dWorldID world, const Pose& zero, dBodyID link,
                   dBodyID parent, bool stops)
    : slides_(joint.type == JointDescription::Type::kPrismatic),
      stops_(stops && std::isfinite(joint.upper)),
      dynamics_(joint.dynamics),
      effort_limit_(joint.effort_limit),
      link_(link),
      parent_(parent),
      guide_(slides_ ? dJointCreateSlider(world, nullptr) : dJointCreateHinge(world, nullptr)) {
  const Eigen::Vector3d axis = zero.rotation * joint.axis;
  dJointAttach(guide_, link, parent);
  if (slides_) {
    dJointSetSliderAxis(guide_, axis[0], axis[1], axis[2]);
  } else {
    dJointSetHingeAnchor(guide_, zero.position[0], zero.position[1], zero.position[2]);
    dJointSetHingeAxis(guide_, axis[0], axis[1], axis[2]);
  }
  if (stops_) {
    if (!slides_ && (joint.lower <= -std::numbers::pi || joint.upper >= std::numbers::pi))
      throw std::invalid_argument("the stops beyond half a turn of joint '" + joint.name + "'");
    Set(guide_, dParamLoStop, joint.lower);
    Set(guide_, dParamHiStop, joint.upper);
  }
  if (dynamics_.armature > 0 || dynamics_.damping > 0 || dynamics_.stiffness > 0) {
    yielding_ = Motor(world, axis);
    Set(yielding_, dParamFMax, dInfinity);
  }
  if (dynamics_.friction > 0) {
    const dJointID brake = Motor(world, axis);
    Set(brake, dParamVel, 0);
    Set(brake, dParamFMax, dynamics_.friction);
  }
}

void OdeJoint::Prepare(double effort, double q, double v, double step) const {
  const double acting = dynamics_.motor_gain * DriveEffort(dynamics_, effort_limit_, effort, q, v);
  slides_ ? dJointAddSliderForce(guide_, acting) : dJointAddHingeTorque(guide_, acting);
  if (stops_) {
    const OdeSoftness softness(kOdeStop, step);
    Set(guide_, dParamStopERP, softness.erp);
    Set(guide_, dParamStopCFM, softness.cfm);
  }
  if (yielding_) {
    // Such a motor makes (wanted speed - v') / CFM, where v' is the speed after the step. This is
    //   armature (v - v') / step - damping v' - stiffness (q + step v' - rest).
    const double cfm =
        1 / (dynamics_.armature / step + dynamics_.damping + dynamics_.stiffness * step);
    Set(yielding_, dParamCFM, cfm);
    Set(yielding_, dParamVel,
        cfm * (dynamics_.armature * v / step - dynamics_.stiffness * (q - dynamics_.rest)));
  }
}

double OdeJoint::Position(double near) const {
  if (slides_) return dJointGetSliderPosition(guide_);
  return near + std::remainder(dJointGetHingeAngle(guide_) - near, 2 * std::numbers::pi);
}

double OdeJoint::Velocity() const {
  if (!slides_) return dJointGetHingeAngleRate(guide_);
  // Not dJointGetSliderPositionRate, which leaves out that the parent turns.
  const dReal* at = dBodyGetPosition(link_);
  const dReal* own = dBodyGetLinearVel(link_);
  dVector3 axis, parents = {};
  if (parent_) dBodyGetPointVel(parent_, at[0], at[1], at[2], parents);
  dJointGetSliderAxis(guide_, axis);
  return axis[0] * (own[0] - parents[0]) + axis[1] * (own[1] - parents[1]) +
         axis[2] * (own[2] - parents[2]);
}

/// One that drives the joint's coordinate.
dJointID OdeJoint::Motor(dWorldID world, const Eigen::Vector3d& axis) const {
  constexpr int kWithLink = 1;
  const dJointID motor =
      slides_ ? dJointCreateLMotor(world, nullptr) : dJointCreateAMotor(world, nullptr);
  dJointAttach(motor, link_, parent_);
  if (slides_) {
    dJointSetLMotorNumAxes(motor, 1);
    dJointSetLMotorAxis(motor, 0, kWithLink, axis[0], axis[1], axis[2]);
  } else {
    dJointSetAMotorNumAxes(motor, 1);
    dJointSetAMotorAxis(motor, 0, kWithLink, axis[0], axis[1], axis[2]);
  }
  return motor;
}

}  // namespace plumb
