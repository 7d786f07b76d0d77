#include "robot/urdf.h"

#include <console_bridge/console.h>
#include <fmt/format.h>
#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

#include "common/config.h"
#include "common/decompositions.h"
#include "robot/urdf_xml.h"

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

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr size_t kMaxJoints = 500;  // as many as are still a robot

struct Pose {
  Eigen::Vector3d at = Eigen::Vector3d::Zero();
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  Pose operator*(const urdf::Pose& inner) const {
    return {at + axes * ToEigen(inner.position), axes * ToEigen(inner.rotation)};
  }
};

class Reader {
 public:
  explicit Reader(const std::string& file) { model_.file = file; }

  UrdfModel Read() {
    xml_ = ReadUrdfXml(ReadFile(model_.file), model_.file);
    model_.warnings = xml_.warnings;
    Complaints complaints;
    const urdf::ModelInterfaceSharedPtr urdf = urdf::parseURDF(xml_.text);
    if (!urdf)
      model_.Fail(xml_.line, complaints.first().empty() ? "is not a URDF" : complaints.first());
    model_.name = urdf->getName();
    const urdf::LinkConstSharedPtr root = urdf->getRoot();
    if (!root) model_.Fail(xml_.line, "has no root link");
    AddLink(root->name, xml_.links.at(root->name).line);
    AddBody(*root, 0, {});
    for (const auto& [name, joint] : xml_.joints) CheckPartNames(name, joint);
    return std::move(model_);
  }

 private:
  void AddLink(const std::string& name, int line) {
    model_.links.push_back({name});
    model_.link_lines.push_back(line);
  }

  // What parts are called must not be taken.
  void CheckPartNames(const std::string& name, const UrdfXml::Joint& joint) const {
    if (joint.type != "planar" && joint.type != "floating") return;
    for (const char* part : {"/x", "/y", "/z", "/angle", "/rotation"}) {
      if (xml_.joints.count(name + part))
        model_.Fail(xml_.joints.at(name + part).line,
                    "joint " + name + part + " is a part of joint " + name);
      if (xml_.links.count(name + part))
        model_.Fail(xml_.links.at(name + part).line,
                    "link " + name + part + " is a part of joint " + name);
    }
  }

  // `pose` of this URDF link in the frame of our link `index`, to which it is rigidly attached;
  // then what hangs on it.
  void AddBody(const urdf::Link& link, int index, const Pose& pose) {
    AddInertia(link, index, pose);
    AddShapes(link, index, pose);
    std::vector<urdf::JointSharedPtr> joints = link.child_joints;  // urdfdom sorts them by name
    std::sort(joints.begin(), joints.end(), [&](const auto& a, const auto& b) {
      return xml_.joints.at(a->name).order < xml_.joints.at(b->name).order;
    });
    for (const urdf::JointSharedPtr& joint : joints) {
      const urdf::Link& child = *child_of(link, *joint);
      const Pose child_pose = pose * joint->parent_to_joint_origin_transform;
      if (joint->type == urdf::Joint::FIXED) {
        AddBody(child, index, child_pose);
      } else {
        AddJoint(*joint, index, child_pose, child);
        AddBody(child, static_cast<int>(model_.links.size()) - 1, {});
      }
    }
  }

  static urdf::LinkSharedPtr child_of(const urdf::Link& link, const urdf::Joint& joint) {
    for (const urdf::LinkSharedPtr& child : link.child_links) {
      if (child->name == joint.child_link_name) return child;
    }
    throw ConfigError("joint " + joint.name + " has no child link");
  }

  // The moving joint, or the chain of them, from our link `parent` to `child`.
  void AddJoint(const urdf::Joint& joint, int parent, const Pose& pose, const urdf::Link& child) {
    using Type = JointDescription::Type;
    const UrdfXml::Joint& xml = xml_.joints.at(joint.name);
    const auto axis = [&] {
      const Eigen::Vector3d a = ToEigen(joint.axis);
      if (!(a.norm() > 1e-9)) model_.Fail(xml.axis_line, "joint " + joint.name + " has no axis");
      return Eigen::Vector3d(a.normalized());
    };
    struct Part {
      const char* suffix;
      Type type;
      Eigen::Vector3d axis;
    };
    std::vector<Part> parts;
    switch (joint.type) {
      case urdf::Joint::REVOLUTE:
        parts = {{"", Type::kRevolute, axis()}};
        break;
      case urdf::Joint::CONTINUOUS:
        parts = {{"", Type::kContinuous, axis()}};
        break;
      case urdf::Joint::PRISMATIC:
        parts = {{"", Type::kPrismatic, axis()}};
        break;
      case urdf::Joint::PLANAR: {
        const Eigen::Vector3d n = axis();
        const bool along_x = n.tail<2>().norm() < 1e-3;
        const Eigen::Vector3d near = along_x ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitX();
        const Eigen::Vector3d x = (near - near.dot(n) * n).normalized();
        parts = {{"/x", Type::kPrismatic, x},
                 {"/y", Type::kPrismatic, n.cross(x)},
                 {"/angle", Type::kContinuous, n}};
        break;
      }
      case urdf::Joint::FLOATING:
        parts = {{"/x", Type::kPrismatic, Eigen::Vector3d::UnitX()},
                 {"/y", Type::kPrismatic, Eigen::Vector3d::UnitY()},
                 {"/z", Type::kPrismatic, Eigen::Vector3d::UnitZ()},
                 {"/rotation", Type::kSpherical, Eigen::Vector3d::UnitX()}};
        break;
      default:
        model_.Fail(xml.line, "joint " + joint.name + " is of a type that is not known");
    }
    if (model_.joints.size() + parts.size() > kMaxJoints) {
      model_.Fail(xml.line, fmt::format("more than {} moving joints", kMaxJoints));
    }
    for (size_t i = 0; i < parts.size(); ++i) {
      JointDescription description;
      description.name = joint.name + parts[i].suffix;
      description.type = parts[i].type;
      description.axis = parts[i].axis;
      description.parent = i == 0 ? parent : static_cast<int>(model_.links.size()) - 1;
      description.child = static_cast<int>(model_.links.size());
      if (i == 0) {
        description.origin = pose.at;
        description.rotation = pose.axes;
      }
      const bool bound =
          description.type == Type::kRevolute || joint.type == urdf::Joint::PRISMATIC;
      description.lower = bound ? xml.lower : -kInfinity;
      description.upper = bound ? xml.upper : kInfinity;
      description.effort_limit = xml.effort;
      description.velocity_limit = xml.velocity;
      description.dynamics.damping = xml.damping;
      description.dynamics.friction = xml.friction;
      model_.joints.push_back(description);
      model_.joint_lines.push_back(xml.line);
      model_.limit_lines.push_back(xml.limit_line);
      model_.part.push_back(parts.size() > 1);
      const bool last = i + 1 == parts.size();
      AddLink(last ? child.name : description.name,
              last ? xml_.links.at(child.name).line : xml.line);
    }
  }

  // <visual> and <collision> of a URDF link.
  void AddShapes(const urdf::Link& link, int index, const Pose& pose) {
    const UrdfXml::Link& xml = xml_.links.at(link.name);
    LinkDescription& ours = model_.links[static_cast<size_t>(index)];
    const auto warn = [&](int line, const char* what) {
      if (index == 0) return;  // does not move
      model_.contact_warnings.push_back(
          fmt::format("{}:{}: link {}: a collision {} does not touch the ground: only spheres, "
                      "capsules and boxes do",
                      model_.file, line, link.name, what));
    };
    for (size_t i = 0; i < link.visual_array.size(); ++i) {
      const urdf::Visual& visual = *link.visual_array[i];
      ours.visuals.push_back(ToShape(*visual.geometry, pose * visual.origin, xml.visuals.at(i)));
    }
    for (size_t i = 0; i < link.collision_array.size(); ++i) {
      const urdf::Collision& collision = *link.collision_array[i];
      ours.collisions.push_back(
          ToShape(*collision.geometry, pose * collision.origin, xml.collisions.at(i)));
      if (ours.collisions.back().type == Shape::Type::kCylinder)
        warn(xml.collisions[i].line, "cylinder");
    }
    for (const int line : xml.collision_meshes) warn(line, "mesh");
  }

  Shape ToShape(const urdf::Geometry& geometry, const Pose& pose, const UrdfXml::Shape& xml) const {
    Shape shape{Shape::Type::kSphere, pose.at, pose.axes, Eigen::Vector3d::Zero()};
    switch (geometry.type) {
      case urdf::Geometry::SPHERE:
        shape.size.x() = static_cast<const urdf::Sphere&>(geometry).radius;
        break;
      case urdf::Geometry::BOX:
        shape.type = Shape::Type::kBox;
        shape.size = ToEigen(static_cast<const urdf::Box&>(geometry).dim);
        break;
      case urdf::Geometry::CYLINDER: {
        const auto& cylinder = static_cast<const urdf::Cylinder&>(geometry);
        shape.type = xml.capsule ? Shape::Type::kCapsule : Shape::Type::kCylinder;
        shape.size = {cylinder.radius, cylinder.length, 0};
        break;
      }
      default:
        model_.Fail(xml.line, "a solid that is not known");
    }
    return shape;
  }

  // Adds the inertia of a URDF link to our link `index` (parallel axis theorem).
  void AddInertia(const urdf::Link& urdf_link, int index, const Pose& pose) {
    if (!urdf_link.inertial) return;
    const urdf::Inertial& inertial = *urdf_link.inertial;
    const double mass = inertial.mass;
    const auto fail = [&](const char* what) {
      model_.Fail(xml_.links.at(urdf_link.name).inertial_line,
                  "link " + urdf_link.name + ": " + what);
    };
    Eigen::Matrix3d inertia;
    inertia << inertial.ixx, inertial.ixy, inertial.ixz,  //
        inertial.ixy, inertial.iyy, inertial.iyz,         //
        inertial.ixz, inertial.iyz, inertial.izz;
    // Principal moments of a body: none negative, none larger than the sum of the others.
    const Eigen::Vector3d moments =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Eigen::MatrixXd(inertia)).eigenvalues();
    const double slack = 1e-9 * moments.cwiseAbs().maxCoeff();
    if (!inertia.allFinite() || moments(0) < -slack ||
        moments(2) > moments(0) + moments(1) + slack) {
      fail("no body can have this inertia");
    }
    if (mass == 0 && !inertia.isZero(0)) fail("inertia without mass");
    const Eigen::Matrix3d rotation = pose.axes * ToEigen(inertial.origin.rotation);
    const Eigen::Vector3d com = pose.at + pose.axes * ToEigen(inertial.origin.position);
    LinkDescription& link = model_.links[static_cast<size_t>(index)];
    const double total = link.mass + mass;
    if (total == 0) return;
    const Eigen::Vector3d center = (link.mass * link.center_of_mass + mass * com) / total;
    const auto about = [&](const Eigen::Matrix3d& own, double m,
                           const Eigen::Vector3d& c) -> Eigen::Matrix3d {
      const Eigen::Vector3d d = c - center;
      return own + m * (d.squaredNorm() * Eigen::Matrix3d::Identity() - d * d.transpose());
    };
    link.inertia = about(link.inertia, link.mass, link.center_of_mass) +
                   about(rotation * inertia * rotation.transpose(), mass, com);
    link.mass = total;
    link.center_of_mass = center;
  }

  UrdfXml xml_;
  UrdfModel model_;
};

}  // namespace

void UrdfModel::Fail(int line, const std::string& what) const {
  throw ConfigError(fmt::format("{}:{}: {}", file, line, what));
}

UrdfModel LoadUrdf(const std::string& file) { return Reader(file).Read(); }

}  // namespace plumb
