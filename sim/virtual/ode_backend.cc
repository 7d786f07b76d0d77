#include "sim/virtual/ode_backend.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/decompositions.h"
#include "robot/contact_points.h"
#include "robot/kinematics.h"
#include "sim/virtual/ode_joint.h"

namespace plumb {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double kGyration = 0.1;   // [m] of a link that has no mass
constexpr double kThinnest = 1e-6;  // of its inertia's trace: ODE knows no rods that are thinner
constexpr double kMost = 1e9;       // [rad/s, m/s, Nm, N] beyond which it is not asked to go

struct DeleteOde {
  void operator()(dxWorld* world) const { dWorldDestroy(world); }
  void operator()(dxJointGroup* group) const { dJointGroupDestroy(group); }
};

void Initialise() {
  static const bool ready = dInitODE2(0) && dCheckConfiguration("ODE_double_precision");
  if (!ready) throw std::invalid_argument("ODE (libode-dev) is not one of double precision");
}

class OdeBackend : public PhysicsBackend {
 public:
  explicit OdeBackend(const RobotDescription& robot)
      : links_(robot.links), kinematics_(robot), points_(ContactPoints(robot)) {
    RequireHingesAndSlides(robot);
    RequireKnownJoints(robot);
    RequireNoLinkContact(robot);
    Initialise();
    world_.reset(dWorldCreate());
    touching_.reset(dJointGroupCreate(0));
    const Vector3d gravity = robot.simulation.gravity * robot.virtual_robot.ground.Down();
    dWorldSetGravity(world_.get(), gravity[0], gravity[1], gravity[2]);
    drift_ = dWorldGetERP(world_.get()) / kOdeStep;
    if (robot.simulation.contact) {
      const double factor = robot.virtual_robot.ground.stiffness_factor;
      ground_ = {kOdeGround.stiffness * factor, kOdeGround.damping * std::sqrt(factor)};
      friction_ = robot.simulation.contact->friction;
    }
    q_ = v_ = VectorXd::Zero(robot.num_velocities());
    AddBodies();
    Place();
    for (size_t i = 0; i < robot.joints.size(); ++i) {
      const JointDescription& joint = robot.joints[i];
      joints_.emplace_back(joint, world_.get(), kinematics_.link(static_cast<int>(i) + 1),
                           bodies_[i + 1], bodies_[static_cast<size_t>(joint.parent)],
                           robot.simulation.stop.has_value());
    }
  }

  void SetState(const Vector& q, const Vector& v) override {
    RequireState(q, v, q_.size(), v_.size());
    q_ = q;
    v_ = v;
    Place();
  }

  bool Advance(const Vector& effort, double duration) override {
    if (!(duration > 0)) return true;
    const VectorXd q = q_, v = v_;
    const int count = static_cast<int>(std::max(1.0, std::ceil(duration / kOdeStep - 1e-6)));
    bool sane = effort.allFinite() && effort.cwiseAbs().maxCoeff() < kMost && Sane();
    for (int i = 0; i < count && sane; ++i) {
      Step(effort, duration / count);
      sane = Sane();
    }
    if (!sane) SetState(q, v);
    return sane;
  }

  const VectorXd& q() const override { return q_; }
  const VectorXd& v() const override { return v_; }

 private:
  void AddBodies() {
    double total = 0;
    for (size_t i = 1; i < links_.size(); ++i) total += links_[i].mass;
    bodies_ = {nullptr};
    for (size_t i = 1; i < links_.size(); ++i) {
      const LinkDescription& link = links_[i];
      const double mass = link.mass > 0 ? link.mass : kOdeLightest * total;
      const Matrix3d inertia =
          link.mass > 0
              ? Matrix3d(link.inertia + kThinnest * link.inertia.trace() * Matrix3d::Identity())
              : Matrix3d(mass * kGyration * kGyration * Matrix3d::Identity());
      if (Eigen::LLT<Eigen::MatrixXd>(Eigen::MatrixXd(inertia)).info() != Eigen::Success)
        throw std::invalid_argument("the inertia of link '" + link.name + "'");
      dMass all;
      dMassSetParameters(&all, mass, 0, 0, 0, inertia(0, 0), inertia(1, 1), inertia(2, 2),
                         inertia(0, 1), inertia(0, 2), inertia(1, 2));
      bodies_.push_back(dBodyCreate(world_.get()));
      dBodySetMass(bodies_.back(), &all);
    }
  }

  /// Puts the bodies where q_ and v_ say.
  void Place() {
    kinematics_.Update(q_, v_);
    for (size_t i = 1; i < bodies_.size(); ++i) {
      const int link = static_cast<int>(i);
      const Vector3d& centre = links_[i].center_of_mass;  // where a body's frame is
      const Vector3d position = kinematics_.Position(link, centre),
                     velocity = kinematics_.Velocity(link, centre),
                     rate = kinematics_.link(link).rate;
      const Matrix3d& r = kinematics_.link(link).rotation;
      const dMatrix3 rotation = {r(0, 0), r(0, 1), r(0, 2), 0,       r(1, 0), r(1, 1),
                                 r(1, 2), 0,       r(2, 0), r(2, 1), r(2, 2), 0};
      dBodySetRotation(bodies_[i], rotation);
      dBodySetPosition(bodies_[i], position[0], position[1], position[2]);
      dBodySetLinearVel(bodies_[i], velocity[0], velocity[1], velocity[2]);
      dBodySetAngularVel(bodies_[i], rate[0], rate[1], rate[2]);
    }
  }

  void Step(const Vector& effort, double step) {
    for (size_t i = 0; i < joints_.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      joints_[i].Prepare(effort[k], q_[k], v_[k], step);
    }
    for (const ContactPoint& point : points_) Touch(point, step);
    dWorldSetERP(world_.get(), drift_ * step);
    dWorldStep(world_.get(), step);
    dJointGroupEmpty(touching_.get());
    for (size_t i = 0; i < joints_.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      q_[k] = joints_[i].Position(q_[k]);
      v_[k] = joints_[i].Velocity();
    }
  }

  void Touch(const ContactPoint& point, double step) {
    const auto link = static_cast<size_t>(point.link);
    const Vector3d from_centre = point.centre - links_[link].center_of_mass;
    dVector3 at;
    dBodyGetRelPointPos(bodies_[link], from_centre[0], from_centre[1], from_centre[2], at);
    const double depth = point.radius - at[2];
    if (!(depth > 0)) return;
    const OdeSoftness softness(ground_, step);
    dContact contact = {};
    contact.surface.mode = dContactApprox1 | dContactFDir1 | dContactSoftERP | dContactSoftCFM;
    contact.surface.mu = friction_;
    contact.surface.soft_erp = softness.erp;
    contact.surface.soft_cfm = softness.cfm;
    contact.fdir1[0] = 1;
    contact.geom.pos[0] = at[0], contact.geom.pos[1] = at[1], contact.geom.pos[2] = -depth;
    contact.geom.normal[2] = 1;
    contact.geom.depth = depth;
    dJointAttach(dJointCreateContact(world_.get(), touching_.get(), &contact), bodies_[link],
                 nullptr);
  }

  /// Whether ODE can go on from here: it ends the process where a number is none.
  bool Sane() const { return q_.allFinite() && v_.allFinite() && v_.cwiseAbs().maxCoeff() < kMost; }

  std::vector<LinkDescription> links_;
  Kinematics kinematics_;
  std::vector<ContactPoint> points_;
  Cushion ground_{};
  double friction_ = 0;
  double drift_ = 0;  // [1/s] at which joints take back what they have drifted apart
  std::unique_ptr<dxWorld, DeleteOde> world_;
  std::unique_ptr<dxJointGroup, DeleteOde> touching_;  // the contacts of a step
  std::vector<dBodyID> bodies_;                        // of each link, null of the base
  std::vector<OdeJoint> joints_;
  VectorXd q_, v_;
};

}  // namespace

std::unique_ptr<PhysicsBackend> MakeOdeBackend(const RobotDescription& robot) {
  return std::make_unique<OdeBackend>(robot);
}

bool HasOde() { return true; }

}  // namespace plumb
