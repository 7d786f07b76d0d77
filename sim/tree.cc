#include "sim/tree.h"

#include <Simbody.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <stdexcept>

namespace plumb {
namespace {

Eigen::Vector3d ToEigen(const SimTK::Vec3& v) { return {v[0], v[1], v[2]}; }

Eigen::Matrix3d ToEigen(const SimTK::Mat33& m) {
  Eigen::Matrix3d result;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) result(row, column) = m(row, column);
  }
  return result;
}

SimTK::Transform ToSimbody(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& position) {
  SimTK::Mat33 m;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) m(row, column) = rotation(row, column);
  }
  return {SimTK::Rotation(m), SimTK::Vec3(position[0], position[1], position[2])};
}

bool IsPrismatic(const JointDescription& joint) { return joint.type == JointDescription::Type::kPrismatic; }

std::vector<int> FindParents(const RobotDescription& description) {
  std::vector<int> parents;
  for (int i = 0; i < description.num_joints(); ++i) {
    const JointDescription& joint = description.joints[static_cast<size_t>(i)];
    if (joint.child != i + 1 || joint.parent < 0 || joint.parent > i) {
      throw std::invalid_argument("joint '" + joint.name + "' is not in depth-first order of a tree");
    }
    parents.push_back(joint.parent - 1);
  }
  return parents;
}

}  // namespace

// Simbody's body frames are the joints' moving frames: z (x for a slide) along the axis, origin at the joint.
// For such frames Simbody has shorter code. `axes` turns them into link axes.
class Tree::Impl {
 public:
  Impl(const RobotDescription& description, const std::vector<int>& parents)
      : matter_(system_),
        velocities_matter_(
            std::any_of(parents.begin(), parents.end(), [](int parent) { return parent >= 0; })) {
    // Kinematics asks for no masses; any will do.
    const SimTK::Body::Rigid body(SimTK::MassProperties(1, SimTK::Vec3(0), SimTK::UnitInertia(1)));
    for (size_t i = 0; i < parents.size(); ++i) {
      const JointDescription& joint = description.joints[i];
      const Eigen::Vector3d own = IsPrismatic(joint) ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitZ();
      const Eigen::Matrix3d axes = Eigen::Quaterniond::FromTwoVectors(own, joint.axis).toRotationMatrix();
      Eigen::Matrix3d to_parent = Eigen::Matrix3d::Identity();  // parent link axes to its Simbody body's
      SimTK::MobilizedBody parent = matter_.Ground();
      if (parents[i] >= 0) {
        const auto p = static_cast<size_t>(parents[i]);
        to_parent = axes_[p].transpose();
        parent = bodies_[p];
      }
      const SimTK::Transform frame = ToSimbody(to_parent * joint.rotation * axes, to_parent * joint.origin);
      axes_.push_back(axes);
      slides_.push_back(IsPrismatic(joint));
      if (slides_.back()) {
        bodies_.push_back(SimTK::MobilizedBody::Slider(parent, frame, body, SimTK::Transform()));
      } else {
        bodies_.push_back(SimTK::MobilizedBody::Pin(parent, frame, body, SimTK::Transform()));
      }
    }
    state_ = system_.realizeTopology();
    system_.realizeModel(state_);
    system_.realize(state_, SimTK::Stage::Time);
    LinkMotion rest;
    rest.axis = rest.angular_velocity = rest.angular_bias = rest.linear_bias = Eigen::Vector3d::Zero();
    links_.assign(bodies_.size(), rest);
  }

  const std::vector<LinkMotion>& Update(const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
    SimTK::Vector& state_q = state_.updQ();
    for (int i = 0; i < q.size(); ++i) state_q[i] = q[i];
    matter_.realizePositionKinematics(state_);
    if (velocities_matter_) {
      SimTK::Vector& state_u = state_.updU();
      for (int i = 0; i < v.size(); ++i) state_u[i] = v[i];
      matter_.realizeVelocityKinematics(state_);
    }
    for (size_t i = 0; i < bodies_.size(); ++i) {
      const SimTK::MobilizedBody& body = bodies_[i];
      LinkMotion& link = links_[i];
      const SimTK::Transform& pose = body.getBodyTransform(state_);
      const Eigen::Matrix3d frame = ToEigen(pose.R().asMat33());
      link.rotation.noalias() = frame * axes_[i].transpose();
      link.position = ToEigen(pose.p());
      if (slides_[i]) {
        link.slide = frame.col(0);
      } else {
        link.axis = frame.col(2);
        link.slide = link.position.cross(link.axis);
      }
      if (!velocities_matter_) continue;
      const SimTK::SpatialVec& bias =
          matter_.getTotalCoriolisAcceleration(state_, body.getMobilizedBodyIndex());
      link.angular_velocity = ToEigen(body.getBodyAngularVelocity(state_));
      link.angular_bias = ToEigen(bias[0]);
      link.linear_bias = ToEigen(bias[1]);
    }
    return links_;
  }

 private:
  SimTK::MultibodySystem system_;  // before its subsystem, which refers to it when destroyed
  SimTK::SimbodyMatterSubsystem matter_;
  SimTK::State state_;
  std::vector<SimTK::MobilizedBody> bodies_;
  std::vector<Eigen::Matrix3d> axes_;
  std::vector<bool> slides_;
  bool velocities_matter_;
  std::vector<LinkMotion> links_;
};

Tree::Tree(const RobotDescription& description) : impl_(nullptr), parents_(FindParents(description)) {
  impl_ = std::make_unique<Impl>(description, parents_);
}

Tree::~Tree() = default;

const std::vector<LinkMotion>& Tree::Update(const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
  return impl_->Update(q, v);
}

}  // namespace plumb
