#include "sim/virtual/simbody_backend.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/decompositions.h"
#include "robot/contact_points.h"
#include "robot/drive_effort.h"
#include "sim/virtual/simbody_tree.h"

namespace plumb {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

void RequireKnown(const RobotDescription& robot) {
  RequireHingesAndSlides(robot);
  RequireKnownJoints(robot);
  RequireNoLinkContact(robot);
  for (const ContactPoint& point : ContactPoints(robot)) {
    if (point.radius > 0) continue;
    throw std::invalid_argument("the edges of link '" +
                                robot.links[static_cast<size_t>(point.link)].name + "'");
  }
}

}  // namespace

class SimbodyBackend::Impl {
 public:
  explicit Impl(const RobotDescription& robot) : tree_(robot), joints_(robot.joints) {
    AddContacts(robot);
    if (robot.simulation.stop) AddStops();
    state_ = tree_.system.realizeTopology();
    tree_.system.realizeModel(state_);
    q_ = v_ = VectorXd::Zero(robot.num_velocities());
    armature_ = q_;
    for (size_t i = 0; i < joints_.size(); ++i)
      armature_[static_cast<Eigen::Index>(i)] = joints_[i].dynamics.armature;
    mass_.resize(v_.size(), v_.size());
    applied_.resize(static_cast<int>(v_.size()));
    none_ = SimTK::Vector(static_cast<int>(v_.size()), 0.0);
  }

  void SetState(const VectorXd& q, const VectorXd& v) {
    q_ = q;
    v_ = v;
    step_ = kLongestStep;
    known_ = false;
  }

  bool Advance(const VectorXd& effort, double duration) {
    if (!(duration > 0)) return true;
    if (!effort.allFinite()) return false;
    const VectorXd q = q_, v = v_;
    try {
      if (Integrate(effort, duration)) return true;
    } catch (const std::exception&) {  // Simbody's checks of its own numbers
    }
    SetState(q, v);
    return false;
  }

  VectorXd Acceleration(const VectorXd& q, const VectorXd& v, const VectorXd& effort) const {
    Write(q, v);
    for (int i = 0; i < applied_.size(); ++i) {
      const JointDescription& joint = joints_[static_cast<size_t>(i)];
      const JointDynamics& d = joint.dynamics;
      applied_[i] = d.motor_gain * DriveEffort(d, joint.effort_limit, effort[i], q[i], v[i]) -
                    d.damping * v[i] - d.stiffness * (q[i] - d.rest) -
                    d.friction * v[i] / std::max(std::abs(v[i]), kStickSpeed);
    }
    tree_.efforts.setAllMobilityForces(state_, applied_);
    tree_.system.realize(state_, SimTK::Stage::Dynamics);
    tree_.matter.calcM(state_, simbody_mass_);
    // What would have to push besides for no acceleration.
    tree_.matter.calcResidualForceIgnoringConstraints(
        state_, tree_.system.getMobilityForces(state_, SimTK::Stage::Dynamics),
        tree_.system.getRigidBodyForces(state_, SimTK::Stage::Dynamics), none_, residual_);
    VectorXd push(v_.size());
    for (int i = 0; i < residual_.size(); ++i) {
      push[i] = -residual_[i];
      for (int k = 0; k < residual_.size(); ++k) mass_(i, k) = simbody_mass_(i, k);
    }
    mass_.diagonal() += armature_;
    return cholesky_.compute(mass_).solve(push);
  }

  Eigen::Vector3d GroundForce() const {
    Write(q_, v_);
    tree_.system.realize(state_, SimTK::Stage::Dynamics);
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const SimTK::Force& contact : contacts_) {
      SimTK::Vector_<SimTK::SpatialVec> on_bodies;
      SimTK::Vector_<SimTK::Vec3> on_particles;
      SimTK::Vector on_joints;
      contact.calcForceContribution(state_, on_bodies, on_particles, on_joints);
      for (int body = 1; body < on_bodies.size(); ++body) {  // 0 is the ground itself
        for (int axis = 0; axis < 3; ++axis) sum[axis] += on_bodies[body][1][axis];
      }
    }
    return sum;
  }

  VectorXd q_, v_;

 private:
  void AddContacts(const RobotDescription& robot) {
    // The half space is where its frame's x is positive: that points down.
    const SimTK::Transform down(SimTK::Rotation(SimTK::Pi / 2, SimTK::YAxis), SimTK::Vec3(0));
    for (const ContactPoint& point : ContactPoints(robot)) {
      const double friction = robot.simulation.contact->friction;
      SimTK::SmoothSphereHalfSpaceForce contact(tree_.forces);
      contact.setParameters(kModulus * robot.virtual_robot.ground.stiffness_factor, kDissipation,
                            friction, kDynamicShare * friction, kViscous, kTransition, kSmoothDepth,
                            kHertzSmoothing, kHuntCrossleySmoothing);
      contact.setContactSphereBody(tree_.links[static_cast<size_t>(point.link)]);
      contact.setContactSphereLocationInBody(ToSimbody(point.centre));
      contact.setContactSphereRadius(point.radius);
      contact.setContactHalfSpaceBody(tree_.matter.Ground());
      contact.setContactHalfSpaceFrame(down);
      contacts_.push_back(contact);
    }
  }

  void AddStops() {
    for (size_t i = 0; i < joints_.size(); ++i) {
      if (!std::isfinite(joints_[i].upper)) continue;
      SimTK::Force::MobilityLinearStop(tree_.forces, tree_.links[i + 1], SimTK::MobilizerQIndex(0),
                                       kStopStiffness, kStopDissipation, joints_[i].lower,
                                       joints_[i].upper);
    }
  }

  /// @return false if no step is short enough.
  bool Integrate(const VectorXd& effort, double duration) {
    VectorXd a1 = known_ && effort == effort_ ? acceleration_ : Acceleration(q_, v_, effort);
    known_ = false;
    double left = duration;
    while (left > 0) {
      const bool last = step_ >= left;
      const double h = last ? left : step_;
      const VectorXd v2 = v_ + h / 2 * a1, a2 = Acceleration(q_ + h / 2 * v_, v2, effort);
      const VectorXd v3 = v_ + 3 * h / 4 * a2, a3 = Acceleration(q_ + 3 * h / 4 * v2, v3, effort);
      const VectorXd q = q_ + h / 9 * (2 * v_ + 3 * v2 + 4 * v3),
                     v = v_ + h / 9 * (2 * a1 + 3 * a2 + 4 * a3);
      const VectorXd a4 = Acceleration(q, v, effort);
      const VectorXd error = h / 72 * (-5 * a1 + 6 * a2 + 8 * a3 - 9 * a4);
      const double ratio = (error.array().abs() / (kTolerance * (1 + v.array().abs()))).maxCoeff();
      // Of third order; not a number is too much, too.
      const double wish = h * std::clamp(0.9 / std::cbrt(ratio), 0.2, 4.0);
      if (!(ratio <= 1)) {
        if (h <= kShortestStep) return false;
        step_ = ratio > 1 ? wish : 0.2 * h;
        continue;
      }
      q_ = q;
      v_ = v;
      a1 = a4;
      left = last ? 0 : left - h;
      // A step that was cut short says little of how long the next may be.
      step_ = std::min(kLongestStep, last ? std::max(step_, wish) : wish);
    }
    if (!q_.allFinite() || !v_.allFinite()) return false;
    effort_ = effort;
    acceleration_ = a1;
    return known_ = true;
  }

  void Write(const VectorXd& q, const VectorXd& v) const {
    SimTK::Vector& state_q = state_.updQ();
    SimTK::Vector& state_u = state_.updU();
    for (int i = 0; i < q.size(); ++i) state_q[i] = q[i];
    for (int i = 0; i < v.size(); ++i) state_u[i] = v[i];
  }

  SimbodyTree tree_;
  std::vector<JointDescription> joints_;
  std::vector<SimTK::Force> contacts_;
  VectorXd armature_;
  double step_ = kLongestStep;  // [s] that the error allows
  bool known_ = false;          // whether acceleration_ is that at q_, v_ under effort_
  VectorXd effort_, acceleration_;
  // Work space: q_, v_ are the state.
  mutable SimTK::State state_;
  mutable SimTK::Vector applied_, residual_;
  mutable SimTK::Matrix simbody_mass_;
  mutable MatrixXd mass_;
  mutable Eigen::LLT<MatrixXd> cholesky_;
  SimTK::Vector none_;
};

SimbodyBackend::SimbodyBackend(const RobotDescription& robot) {
  RequireKnown(robot);
  try {
    impl_ = std::make_unique<Impl>(robot);
  } catch (const SimTK::Exception::Base& error) {
    throw std::invalid_argument(std::string("Simbody cannot build this robot: ") + error.what());
  }
}

SimbodyBackend::~SimbodyBackend() = default;

void SimbodyBackend::SetState(const Vector& q, const Vector& v) {
  RequireState(q, v, impl_->q_.size(), impl_->v_.size());
  impl_->SetState(q, v);
}

bool SimbodyBackend::Advance(const Vector& effort, double duration) {
  return impl_->Advance(effort, duration);
}

const VectorXd& SimbodyBackend::q() const { return impl_->q_; }
const VectorXd& SimbodyBackend::v() const { return impl_->v_; }

VectorXd SimbodyBackend::Acceleration(const Vector& effort) const {
  return impl_->Acceleration(impl_->q_, impl_->v_, effort);
}

Eigen::Vector3d SimbodyBackend::GroundForce() const { return impl_->GroundForce(); }

std::unique_ptr<PhysicsBackend> MakeSimbodyBackend(const RobotDescription& robot) {
  return std::make_unique<SimbodyBackend>(robot);
}

}  // namespace plumb
