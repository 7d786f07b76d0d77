#include "robot/urdf.h"

#include <fmt/format.h>
#include <console_bridge/console.h>
#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>

#include "common/config.h"

namespace plumb {
namespace {

// urdfdom reports through console_bridge; the first complaint becomes ours.
class Complaints : public console_bridge::OutputHandler {
 public:
  Complaints() { console_bridge::useOutputHandler(this); }
  ~Complaints() override { console_bridge::restorePreviousOutputHandler(); }
  void log(const std::string& text, console_bridge::LogLevel level, const char*, int) override {
    if (level >= console_bridge::CONSOLE_BRIDGE_LOG_ERROR && first_.empty()) first_ = text;
  }
  const std::string& first() const { return first_; }

 private:
  std::string first_;
};

Eigen::Vector3d ToEigen(const urdf::Vector3& v) { return {v.x, v.y, v.z}; }

Eigen::Matrix3d ToEigen(const urdf::Rotation& r) {
  return Eigen::Quaterniond(r.w, r.x, r.y, r.z).normalized().toRotationMatrix();
}

class Reader {
 public:
  explicit Reader(std::string file) : file_(std::move(file)) {}

  UrdfModel Read() {
    std::ifstream stream(file_, std::ios::binary);
    if (!stream) Fail("cannot be opened");
    const std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
    Complaints complaints;
    const urdf::ModelInterfaceSharedPtr urdf = urdf::parseURDF(text);
    if (!urdf) Fail(complaints.first().empty() ? "is not a URDF" : complaints.first());
    model_.name = urdf->getName();
    const urdf::LinkConstSharedPtr root = urdf->getRoot();
    if (!root) Fail("has no root link");
    model_.links.push_back({root->name});
    AddInertia(*root, 0, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity());
    Descend(*root, 0, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity());
    for (size_t i = 1; i < model_.links.size(); ++i) {
      if (!(model_.links[i].mass > 0)) Fail("link " + model_.links[i].name + " moves but has no mass");
    }
    return std::move(model_);
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const { throw ConfigError(file_ + ": " + what); }

  // `at`, `axes`: pose of this URDF link in the frame of our link `index`, to which it is rigidly attached.
  void Descend(const urdf::Link& link, int index, const Eigen::Vector3d& at, const Eigen::Matrix3d& axes) {
    for (const urdf::JointSharedPtr& joint : link.child_joints) {
      const urdf::Link& child = *child_of(link, *joint);
      const urdf::Pose& pose = joint->parent_to_joint_origin_transform;
      const Eigen::Vector3d child_at = at + axes * ToEigen(pose.position);
      const Eigen::Matrix3d child_axes = axes * ToEigen(pose.rotation);
      if (joint->type == urdf::Joint::FIXED) {
        AddInertia(child, index, child_at, child_axes);
        Descend(child, index, child_at, child_axes);
        continue;
      }
      JointDescription description = ReadJoint(*joint);
      description.parent = index;
      description.child = static_cast<int>(model_.links.size());
      description.origin = child_at;
      description.rotation = child_axes;
      model_.joints.push_back(description);
      model_.links.push_back({child.name});
      const int child_index = description.child;
      AddInertia(child, child_index, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity());
      Descend(child, child_index, Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity());
    }
  }

  static urdf::LinkSharedPtr child_of(const urdf::Link& link, const urdf::Joint& joint) {
    for (const urdf::LinkSharedPtr& child : link.child_links) {
      if (child->name == joint.child_link_name) return child;
    }
    throw ConfigError("joint " + joint.name + " has no child link");
  }

  JointDescription ReadJoint(const urdf::Joint& joint) const {
    JointDescription description;
    description.name = joint.name;
    const std::string label = "joint " + joint.name;
    switch (joint.type) {
      case urdf::Joint::REVOLUTE: description.type = JointDescription::Type::kRevolute; break;
      case urdf::Joint::CONTINUOUS: description.type = JointDescription::Type::kContinuous; break;
      case urdf::Joint::PRISMATIC: description.type = JointDescription::Type::kPrismatic; break;
      default: Fail(label + " is not fixed, revolute, continuous or prismatic");
    }
    description.axis = ToEigen(joint.axis);
    if (!(description.axis.norm() > 1e-9)) Fail(label + " has no axis");
    description.axis.normalize();
    if (!joint.limits) Fail(label + " has no <limit>: effort and velocity are needed");
    description.effort_limit = joint.limits->effort;
    description.velocity_limit = joint.limits->velocity;
    if (!(description.effort_limit > 0 && std::isfinite(description.effort_limit))) {
      Fail(label + ": limit effort must be positive");
    }
    if (!(description.velocity_limit > 0 && std::isfinite(description.velocity_limit))) {
      Fail(label + ": limit velocity must be positive");
    }
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    const bool endless = description.type == JointDescription::Type::kContinuous;
    description.lower = endless ? -kInfinity : joint.limits->lower;
    description.upper = endless ? kInfinity : joint.limits->upper;
    if (!(description.lower < description.upper)) Fail(label + ": limit lower must be below upper");
    return description;
  }

  // Adds the inertia of a URDF link to our link `index` (parallel axis theorem).
  void AddInertia(const urdf::Link& urdf_link, int index, const Eigen::Vector3d& at, const Eigen::Matrix3d& axes) {
    if (!urdf_link.inertial) return;
    const urdf::Inertial& inertial = *urdf_link.inertial;
    const std::string label = "link " + urdf_link.name;
    const double mass = inertial.mass;
    if (!(mass >= 0 && std::isfinite(mass))) Fail(label + ": mass must not be negative");
    Eigen::Matrix3d inertia;
    inertia << inertial.ixx, inertial.ixy, inertial.ixz,  //
        inertial.ixy, inertial.iyy, inertial.iyz,         //
        inertial.ixz, inertial.iyz, inertial.izz;
    // Principal moments of a body: none negative, none larger than the sum of the others.
    const Eigen::Vector3d moments = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(inertia).eigenvalues();
    const double slack = 1e-9 * moments.cwiseAbs().maxCoeff();
    if (!inertia.allFinite() || moments(0) < -slack || moments(2) > moments(0) + moments(1) + slack) {
      Fail(label + ": no body can have this inertia");
    }
    const Eigen::Matrix3d rotation = axes * ToEigen(inertial.origin.rotation);
    const Eigen::Vector3d com = at + axes * ToEigen(inertial.origin.position);
    LinkDescription& link = model_.links[static_cast<size_t>(index)];
    const double total = link.mass + mass;
    if (total == 0) return;
    const Eigen::Vector3d center = (link.mass * link.center_of_mass + mass * com) / total;
    const auto about = [&](const Eigen::Matrix3d& own, double m, const Eigen::Vector3d& c) -> Eigen::Matrix3d {
      const Eigen::Vector3d d = c - center;
      return own + m * (d.squaredNorm() * Eigen::Matrix3d::Identity() - d * d.transpose());
    };
    link.inertia = about(link.inertia, link.mass, link.center_of_mass) +
                   about(rotation * inertia * rotation.transpose(), mass, com);
    link.mass = total;
    link.center_of_mass = center;
  }

  std::string file_;
  UrdfModel model_;
};

}  // namespace

UrdfModel LoadUrdf(const std::string& file) { return Reader(file).Read(); }

}  // namespace plumb
