#include "sim/plant.h"

#include <Simbody.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

namespace plumb {
namespace {

using Eigen::VectorXd;

SimTK::Vec3 ToSimbody(const Eigen::Vector3d& v) { return {v[0], v[1], v[2]}; }

SimTK::Rotation ToSimbody(const Eigen::Matrix3d& m) {
  return SimTK::Rotation(
      SimTK::Mat33(m(0, 0), m(0, 1), m(0, 2), m(1, 0), m(1, 1), m(1, 2), m(2, 0), m(2, 1), m(2, 2)));
}

SimTK::MassProperties ToSimbody(const InertialModel::Body& body) {
  const Eigen::Matrix3d& i = body.inertia;
  const SimTK::Inertia central(i(0, 0), i(1, 1), i(2, 2), i(0, 1), i(0, 2), i(1, 2));
  const SimTK::Vec3 center = ToSimbody(body.center_of_mass);
  return {body.mass, center, central.shiftFromMassCenter(-center, body.mass)};
}

}  // namespace

class Plant::Impl {
 public:
  Impl(const RobotDescription& description, const InertialModel& inertias, double max_step)
      : matter_(system_), forces_(system_), efforts_(forces_, matter_), max_step_(max_step) {
    const SimTK::Force::Gravity gravity(forces_, matter_, SimTK::Vec3(0, 0, -inertias.gravity));
    std::vector<SimTK::MobilizedBody> links{matter_.Ground()};
    for (size_t i = 0; i < description.joints.size(); ++i) {
      const JointDescription& joint = description.joints[i];
      if (joint.child != static_cast<int>(i) + 1 || joint.parent < 0 || joint.parent > static_cast<int>(i)) {
        throw std::invalid_argument("joint '" + joint.name + "' is not in depth-first order of a tree");
      }
      // Simbody turns about z and slides along x; body frames are the URDF's link frames.
      const bool slides = joint.type == JointDescription::Type::kPrismatic;
      const SimTK::Rotation to_axis(
          SimTK::UnitVec3(ToSimbody(joint.axis)),
          slides ? SimTK::CoordinateAxis(SimTK::XAxis) : SimTK::CoordinateAxis(SimTK::ZAxis));
      const SimTK::Transform outboard(to_axis);
      const SimTK::Transform inboard(ToSimbody(joint.rotation) * to_axis, ToSimbody(joint.origin));
      const SimTK::Body::Rigid body(ToSimbody(inertias.bodies[i]));
      SimTK::MobilizedBody& parent = links[static_cast<size_t>(joint.parent)];
      if (slides) {
        links.push_back(SimTK::MobilizedBody::Slider(parent, inboard, body, outboard));
      } else {
        links.push_back(SimTK::MobilizedBody::Pin(parent, inboard, body, outboard));
      }
    }
    state_ = system_.realizeTopology();
    system_.realizeModel(state_);
    const auto n = static_cast<Eigen::Index>(description.joints.size());
    q_ = v_ = VectorXd::Zero(n);
    applied_.resize(static_cast<int>(n));
  }

  bool Advance(const VectorXd& effort, double duration) {
    if (!(duration > 0)) return true;
    if (!effort.allFinite()) return false;
    const double count = std::max(1.0, std::ceil(duration / max_step_ - 1e-6));
    const double h = duration / count;
    for (double i = 0; i < count; ++i) {
      if (!Step(effort, h)) return false;
    }
    return true;
  }

  VectorXd Acceleration(const VectorXd& q, const VectorXd& v, const VectorXd& effort) const {
    const auto n = static_cast<int>(q.size());
    SimTK::Vector& state_q = state_.updQ();
    SimTK::Vector& state_u = state_.updU();
    for (int i = 0; i < n; ++i) {
      state_q[i] = q[i];
      state_u[i] = v[i];
      applied_[i] = effort[i];
    }
    efforts_.setAllMobilityForces(state_, applied_);
    system_.realize(state_, SimTK::Stage::Acceleration);
    const SimTK::Vector& udot = state_.getUDot();
    VectorXd result(n);
    for (int i = 0; i < n; ++i) result[i] = udot[i];
    return result;
  }

  VectorXd q_, v_;

 private:
  bool Step(const VectorXd& effort, double h) {
    try {
      const VectorXd a1 = Acceleration(q_, v_, effort);
      const VectorXd v2 = v_ + h / 2 * a1;
      const VectorXd a2 = Acceleration(q_ + h / 2 * v_, v2, effort);
      const VectorXd v3 = v_ + h / 2 * a2;
      const VectorXd a3 = Acceleration(q_ + h / 2 * v2, v3, effort);
      const VectorXd v4 = v_ + h * a3;
      const VectorXd a4 = Acceleration(q_ + h * v3, v4, effort);
      const VectorXd q = q_ + h / 6 * (v_ + 2 * v2 + 2 * v3 + v4);
      const VectorXd v = v_ + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
      if (!q.allFinite() || !v.allFinite()) return false;
      q_ = q;
      v_ = v;
      return true;
    } catch (const std::exception&) {
      return false;  // Simbody's checks of its own numbers
    }
  }

  SimTK::MultibodySystem system_;  // before its subsystems, which refer to it when destroyed
  SimTK::SimbodyMatterSubsystem matter_;
  SimTK::GeneralForceSubsystem forces_;
  SimTK::Force::DiscreteForces efforts_;
  mutable SimTK::State state_;  // work space: q_, v_ are the plant's state
  mutable SimTK::Vector applied_;
  double max_step_;
};

Plant::Plant(const RobotDescription& description, const InertialModel& inertias, double max_step) {
  try {
    impl_ = std::make_unique<Impl>(description, inertias, max_step);
  } catch (const SimTK::Exception::Base& error) {
    throw std::invalid_argument(std::string("Simbody cannot build this robot: ") + error.what());
  }
}

Plant::~Plant() = default;

void Plant::SetState(const Eigen::Ref<const VectorXd>& q, const Eigen::Ref<const VectorXd>& v) {
  if (q.size() != impl_->q_.size() || v.size() != impl_->v_.size()) {
    throw std::invalid_argument("a state has " + std::to_string(impl_->q_.size()) +
                                " positions and velocities");
  }
  if (!q.allFinite() || !v.allFinite()) throw std::invalid_argument("a plant's state must be finite");
  impl_->q_ = q;
  impl_->v_ = v;
}

bool Plant::Advance(const Eigen::Ref<const VectorXd>& effort, double duration) {
  return impl_->Advance(effort, duration);
}

const VectorXd& Plant::q() const { return impl_->q_; }
const VectorXd& Plant::v() const { return impl_->v_; }

VectorXd Plant::Acceleration(const Eigen::Ref<const VectorXd>& effort) const {
  return impl_->Acceleration(impl_->q_, impl_->v_, effort);
}

}  // namespace plumb
