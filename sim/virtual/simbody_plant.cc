#include "sim/virtual/simbody_plant.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exception>
#include <stdexcept>
#include <string>
#include <vector>

#include "robot/drive_effort.h"
#include "sim/virtual/simbody_tree.h"

namespace plumb {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

using Type = JointDescription::Type;

}  // namespace

class SimbodyPlant::Impl {
 public:
  Impl(const RobotDescription& robot, double max_step)
      : tree_(robot), joints_(robot.joints), max_step_(max_step) {
    state_ = tree_.system.realizeTopology();
    tree_.system.realizeModel(state_);
    q_ = VectorXd::Zero(robot.num_positions());
    v_ = VectorXd::Zero(robot.num_velocities());
    for (int i = 0; i < robot.num_joints(); ++i) {
      if (joints_[static_cast<size_t>(i)].type == Type::kSpherical) q_[robot.position_of(i)] = 1;
    }
    applied_.resize(static_cast<int>(v_.size()));
  }

  bool Advance(const VectorXd& effort, double duration) {
    if (!(duration > 0)) return true;
    if (!effort.allFinite()) return false;
    const double count = std::max(1.0, std::ceil(duration / max_step_ - 1e-6));
    const double h = duration / count;
    const VectorXd q = q_, v = v_;
    for (int64_t i = 0; static_cast<double>(i) < count; ++i) {
      if (Step(effort, h)) continue;
      q_ = q, v_ = v;
      return false;
    }
    return true;
  }

  VectorXd Acceleration(const VectorXd& q, const VectorXd& v, const VectorXd& effort) const {
    Write(q, v);
    const VectorXd all = OnJoints(q, v, effort);
    for (int i = 0; i < applied_.size(); ++i) applied_[i] = all[i];
    tree_.efforts.setAllMobilityForces(state_, applied_);
    tree_.system.realize(state_, SimTK::Stage::Acceleration);
    return Read(state_.getUDot());
  }

  MatrixXd MassMatrix() const {
    Write(q_, v_);
    tree_.system.realize(state_, SimTK::Stage::Position);
    SimTK::Matrix mass;
    tree_.matter.calcM(state_, mass);
    MatrixXd result(v_.size(), v_.size());
    for (int row = 0; row < result.rows(); ++row) {
      for (int column = 0; column < result.cols(); ++column)
        result(row, column) = mass(row, column);
    }
    const MatrixXd turn = Turn(q_);
    return turn.transpose() * result * turn;
  }

  VectorXd Bias() const {
    Write(q_, v_);
    tree_.efforts.clearAllForces(state_);
    tree_.system.realize(state_, SimTK::Stage::Dynamics);
    SimTK::Vector residual;
    const SimTK::Vector none(static_cast<int>(v_.size()), 0.0);
    tree_.matter.calcResidualForceIgnoringConstraints(
        state_, none, tree_.system.getRigidBodyForces(state_, SimTK::Stage::Dynamics), none,
        residual);
    VectorXd result(v_.size());
    for (int i = 0; i < residual.size(); ++i) result[i] = residual[i];
    return Turn(q_).transpose() * result;
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

  // Our velocities to Simbody's: a ball joint's are in the parent's axes there, in the link's here.
  MatrixXd Turn(const VectorXd& q) const {
    MatrixXd turn = MatrixXd::Identity(v_.size(), v_.size());
    Eigen::Index position = 0, velocity = 0;
    for (const JointDescription& joint : joints_) {
      if (joint.type == Type::kSpherical) {
        const Eigen::Quaterniond rotation(q[position], q[position + 1], q[position + 2],
                                          q[position + 3]);
        turn.block<3, 3>(velocity, velocity) = rotation.normalized().toRotationMatrix();
      }
      position += joint.num_positions();
      velocity += joint.num_velocities();
    }
    return turn;
  }

  void Write(const VectorXd& q, const VectorXd& v) const {
    SimTK::Vector& state_q = state_.updQ();
    SimTK::Vector& state_u = state_.updU();
    const VectorXd u = Turn(q) * v;
    for (int i = 0; i < q.size(); ++i) state_q[i] = q[i];
    for (int i = 0; i < u.size(); ++i) state_u[i] = u[i];
  }

  VectorXd Read(const SimTK::Vector& udot) const {
    VectorXd result(v_.size());
    for (int i = 0; i < udot.size(); ++i) result[i] = udot[i];
    return Turn(q_).transpose() * result;
  }

  VectorXd OnJoints(const VectorXd& q, const VectorXd& v, const VectorXd& effort) const {
    VectorXd all = Turn(q) * effort;
    Eigen::Index position = 0, velocity = 0;
    for (const JointDescription& joint : joints_) {
      const JointDynamics& d = joint.dynamics;
      if (joint.type != Type::kSpherical) {
        const double speed = v[velocity];
        all[velocity] = d.motor_gain * DriveEffort(d, joint.effort_limit, effort[velocity],
                                                   q[position], speed) -
                        d.damping * speed - d.stiffness * (q[position] - d.rest) -
                        d.friction * speed / std::max(std::abs(speed), kStickSpeed);
      }
      position += joint.num_positions();
      velocity += joint.num_velocities();
    }
    return all;
  }

  SimbodyTree tree_;
  std::vector<JointDescription> joints_;
  mutable SimTK::State state_;  // work space: q_, v_ are the plant's state
  mutable SimTK::Vector applied_;
  double max_step_;
};

SimbodyPlant::SimbodyPlant(const RobotDescription& robot, double max_step) {
  try {
    impl_ = std::make_unique<Impl>(robot, max_step);
  } catch (const SimTK::Exception::Base& error) {
    throw std::invalid_argument(std::string("Simbody cannot build this robot: ") + error.what());
  }
}

std::string SimbodyPlant::Lacks(const RobotDescription& robot) {
  if (robot.simulation.contact) return "contact with the ground";
  for (const JointDescription& joint : robot.joints) {
    const std::string of = " of joint '" + joint.name + "'";
    if (joint.type == Type::kSpherical) return "the free rotation" + of;
    if (robot.simulation.stop && std::isfinite(joint.upper)) return "the stops" + of;
    const JointParameterKind* lacking = FirstNotAmong(
        {&JointDynamics::damping, &JointDynamics::friction, &JointDynamics::stiffness,
         &JointDynamics::rest, &JointDynamics::kp, &JointDynamics::kd, &JointDynamics::motor_gain},
        joint.dynamics);
    if (lacking) return lacking->noun + of;
  }
  return "";
}

SimbodyPlant::~SimbodyPlant() = default;

void SimbodyPlant::SetState(const Eigen::Ref<const VectorXd>& q,
                            const Eigen::Ref<const VectorXd>& v) {
  if (q.size() != impl_->q_.size() || v.size() != impl_->v_.size()) {
    throw std::invalid_argument("a state has " + std::to_string(impl_->q_.size()) +
                                " positions and velocities");
  }
  if (!q.allFinite() || !v.allFinite())
    throw std::invalid_argument("a plant's state must be finite");
  impl_->q_ = q;
  impl_->v_ = v;
}

bool SimbodyPlant::Advance(const Eigen::Ref<const VectorXd>& effort, double duration) {
  return impl_->Advance(effort, duration);
}

const VectorXd& SimbodyPlant::q() const { return impl_->q_; }
const VectorXd& SimbodyPlant::v() const { return impl_->v_; }

Eigen::MatrixXd SimbodyPlant::MassMatrix() const { return impl_->MassMatrix(); }
VectorXd SimbodyPlant::Bias() const { return impl_->Bias(); }

VectorXd SimbodyPlant::Acceleration(const Eigen::Ref<const VectorXd>& effort) const {
  return impl_->Acceleration(impl_->q_, impl_->v_, effort);
}

}  // namespace plumb
