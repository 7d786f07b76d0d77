#include "robot/urdf/urdf.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <utility>

#include "common/config.h"
#include "common/decompositions.h"
#include "common/nearest_name.h"
#include "common/special_numbers.h"
#include "robot/urdf/elements.h"
#include "robot/urdf/mesh.h"

namespace plumb {
namespace {

constexpr size_t kMaxJoints = 500;      // as many as are still a robot
constexpr size_t kMaxMeshes = 100;      // and as many files
constexpr double kWorthSaying = 0.001;  // [m] that a hull has lost

using Pose = UrdfElements::Pose;

class ModelReader {
 public:
  ModelReader(const std::string& file, const std::vector<std::string>& fixed)
      : elements_(ReadUrdfElements(ReadFile(file), file)) {
    model_.file = file;
    for (const std::string& name : fixed) Fix(name);
  }

  UrdfModel Read() {
    model_.name = elements_.name;
    model_.warnings = elements_.warnings;
    AddLink(elements_.root, elements_.links.at(elements_.root).line);
    AddBody(elements_.root, 0, {});
    for (const auto& [name, joint] : elements_.joints) CheckPartNames(name, joint);
    return std::move(model_);
  }

 private:
  void Fix(const std::string& name) {
    const auto joint = elements_.joints.find(name);
    if (joint != elements_.joints.end() && joint->second.type != "fixed") {
      joint->second.type = "fixed";
      return;
    }
    std::vector<std::string> moving;
    for (const auto& [other, element] : elements_.joints) {
      if (element.type != "fixed") moving.push_back(other);
    }
    throw std::invalid_argument(
        fmt::format("\"{}\" is not a moving joint of the URDF{}", name,
                    moving.empty() ? "" : "; did you mean " + NearestName(name, moving) + "?"));
  }

  void AddLink(const std::string& name, int line) {
    model_.links.push_back({name});
    model_.link_lines.push_back(line);
  }

  // The names of parts must be free.
  void CheckPartNames(const std::string& name, const UrdfElements::Joint& joint) const {
    if (joint.type != "planar" && joint.type != "floating") return;
    for (const char* part : {"/x", "/y", "/z", "/angle", "/rotation"}) {
      const std::string whole = name + part;
      if (elements_.joints.count(whole))
        model_.Fail(elements_.joints.at(whole).line,
                    fmt::format("joint {} is a part of joint {}", whole, name));
      if (elements_.links.count(whole))
        model_.Fail(elements_.links.at(whole).line,
                    fmt::format("link {} is a part of joint {}", whole, name));
    }
  }

  // `pose` of this URDF link in the frame of our link `index`, to which it is rigidly attached;
  // then what hangs on it.
  void AddBody(const std::string& name, int index, const Pose& pose) {
    const UrdfElements::Link& link = elements_.links.at(name);
    if (link.inertial) AddInertia(name, *link.inertial, index, pose);
    AddSolids(name, link, index, pose);
    for (const std::string& joint_name : link.joints) {
      const UrdfElements::Joint& joint = elements_.joints.at(joint_name);
      const Pose child_pose = pose * joint.origin;
      if (joint.type == "fixed") {
        model_.links[static_cast<size_t>(index)].fixed.push_back({joint.child, joint_name});
        AddBody(joint.child, index, child_pose);
      } else {
        AddJoint(joint_name, joint, index, child_pose);
        AddBody(joint.child, static_cast<int>(model_.links.size()) - 1, {});
      }
    }
  }

  // The moving joint, or the chain of them, from our link `parent` to its child.
  void AddJoint(const std::string& name, const UrdfElements::Joint& joint, int parent,
                const Pose& pose) {
    using Type = JointGeometry::Type;
    const auto axis = [&] {
      if (!(joint.axis.norm() > 1e-9))
        model_.Fail(joint.axis_line, "joint " + name + " has no axis");
      return Eigen::Vector3d(joint.axis.normalized());
    };
    struct Part {
      const char* suffix;
      Type type;
      Eigen::Vector3d axis;
    };
    std::vector<Part> parts;
    if (joint.type == "revolute") {
      parts = {{"", Type::kRevolute, axis()}};
    } else if (joint.type == "continuous") {
      parts = {{"", Type::kContinuous, axis()}};
    } else if (joint.type == "prismatic") {
      parts = {{"", Type::kPrismatic, axis()}};
    } else if (joint.type == "planar") {
      const Eigen::Vector3d n = axis();
      const bool along_x = n.tail<2>().norm() < 1e-3;
      const Eigen::Vector3d near = along_x ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitX();
      const Eigen::Vector3d x = (near - near.dot(n) * n).normalized();
      parts = {{"/x", Type::kPrismatic, x},
               {"/y", Type::kPrismatic, n.cross(x)},
               {"/angle", Type::kContinuous, n}};
    } else {  // floating
      parts = {{"/x", Type::kPrismatic, Eigen::Vector3d::UnitX()},
               {"/y", Type::kPrismatic, Eigen::Vector3d::UnitY()},
               {"/z", Type::kPrismatic, Eigen::Vector3d::UnitZ()},
               {"/rotation", Type::kSpherical, Eigen::Vector3d::UnitX()}};
    }
    if (model_.joints.size() + parts.size() > kMaxJoints) {
      model_.Fail(joint.line, fmt::format("more than {} moving joints", kMaxJoints));
    }
    for (size_t i = 0; i < parts.size(); ++i) {
      UrdfJoint part;
      part.name = name + parts[i].suffix;
      part.type = parts[i].type;
      part.axis = parts[i].axis;
      part.parent = i == 0 ? parent : static_cast<int>(model_.links.size()) - 1;
      part.child = static_cast<int>(model_.links.size());
      if (i == 0) {
        part.origin = pose.at;
        part.rotation = pose.axes;
      }
      const bool bound = joint.type == "revolute" || joint.type == "prismatic";
      part.lower = bound ? joint.lower : -kInfinity;
      part.upper = bound ? joint.upper : kInfinity;
      part.effort_limit = joint.effort;
      part.velocity_limit = joint.velocity;
      part.damping = joint.damping;
      part.friction = joint.friction;
      part.part = parts.size() > 1;
      part.line = joint.line;
      part.limit_line = joint.limit_line;
      model_.joints.push_back(part);
      const bool last = i + 1 == parts.size();
      AddLink(last ? joint.child : part.name,
              last ? elements_.links.at(joint.child).line : joint.line);
    }
  }

  // <visual> and <collision> of a URDF link.
  void AddSolids(const std::string& name, const UrdfElements::Link& link, int index,
                 const Pose& pose) {
    LinkDescription& ours = model_.links[static_cast<size_t>(index)];
    const auto add = [&](Shape shape, std::vector<Shape>* to) {
      shape.position = pose.at + pose.axes * shape.position;
      shape.rotation = pose.axes * shape.rotation;
      to->push_back(shape);
    };
    const auto warn = [&](int line, const std::string& what) {
      const bool moves = index > 0;
      (moves ? model_.contact_warnings : model_.pair_warnings)
          .push_back(fmt::format("{}:{}: link {}: a collision {} touches nothing: only spheres, "
                                 "capsules and boxes do{}",
                                 model_.file, line, name, what, moves ? ", and meshes" : ""));
    };
    for (const UrdfElements::Solid& visual : link.visuals) add(visual.shape, &ours.visuals);
    for (const UrdfElements::Solid& collision : link.collisions) {
      add(collision.shape, &ours.collisions);
      if (collision.shape.type == Shape::Type::kCylinder) warn(collision.line, "cylinder");
    }
    for (UrdfElements::Mesh mesh : link.collision_meshes) {
      if (index == 0) {
        warn(mesh.line, "mesh");
        continue;
      }
      mesh.origin = pose * mesh.origin;
      model_.collision_meshes.push_back({index, name, std::move(mesh)});
    }
  }

  // Adds the inertia of a URDF link to our link `index` (parallel axis theorem).
  void AddInertia(const std::string& name, const UrdfElements::Inertial& inertial, int index,
                  const Pose& pose) {
    const double mass = inertial.mass;
    const Eigen::Matrix3d& inertia = inertial.inertia;
    const auto fail = [&](const char* what) {
      model_.Fail(inertial.line, "link " + name + ": " + what);
    };
    // Principal moments of a body: none negative, none larger than the sum of the others.
    const Eigen::Vector3d moments =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Eigen::MatrixXd(inertia)).eigenvalues();
    const double slack = 1e-9 * moments.cwiseAbs().maxCoeff();
    if (!inertia.allFinite() || moments(0) < -slack ||
        moments(2) > moments(0) + moments(1) + slack) {
      fail("no body can have this inertia");
    }
    if (mass == 0 && !inertia.isZero(0)) fail("inertia without mass");
    const auto [com, rotation] = pose * inertial.origin;
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

  UrdfElements elements_;
  UrdfModel model_;
};

}  // namespace

void UrdfModel::Fail(int line, const std::string& what) const {
  throw ConfigError(fmt::format("{}:{}: {}", file, line, what));
}

std::vector<std::string> UrdfModel::LoadCollisionMeshes() {
  std::map<std::string, std::vector<Eigen::Vector3d>> points_of;  // of each file, read once
  for (const Mesh& one : collision_meshes) {
    const UrdfElements::Mesh& mesh = one.mesh;
    const std::string place = fmt::format("{}:{}: ", file, mesh.line),
                      what = fmt::format("link {}: collision mesh {}", one.link_name, mesh.file);
    if (!IsMeshFormat(mesh.file)) {
      contact_warnings.push_back(place + what +
                                 " does not touch the ground: it is neither STL nor OBJ");
      continue;
    }
    const std::string path = FindMesh(mesh.file, file);
    if (path.empty()) Fail(mesh.line, what + ": there is no such file");
    const auto [points, is_new] = points_of.try_emplace(path);
    if (points_of.size() > kMaxMeshes)
      Fail(mesh.line, fmt::format("{} is one of more than {}", what, kMaxMeshes));
    try {
      if (is_new) points->second = MeshPoints(ReadFile(path));
    } catch (const std::runtime_error& error) {
      Fail(mesh.line, what + ": " + error.what());
    }
    HullCorners hull = FindHullCorners(points->second, mesh.scale);
    if (hull.lost > kWorthSaying) {
      contact_warnings.push_back(
          place + what +
          fmt::format(" touches the ground with {} corners of its hull: it reaches up to {:.1f} mm "
                      "farther",
                      hull.corners.size(), 1000 * hull.lost));
    }
    Shape shape{Shape::Type::kMesh, mesh.origin.at, mesh.origin.axes};
    shape.corners = std::move(hull.corners);
    links[static_cast<size_t>(one.link)].collisions.push_back(std::move(shape));
  }
  std::vector<std::string> files;
  files.reserve(points_of.size());
  for (const auto& [path, points] : points_of) files.push_back(path);
  return files;
}

std::string FindUrdf(Config& robot) {
  namespace fs = std::filesystem;
  const std::string name = robot.String("urdf");
  const fs::path beside_key = fs::path(robot.FileOf("urdf")).parent_path() / name,
                 beside_file = fs::path(robot.file()).parent_path() / name;
  std::error_code error;
  for (const fs::path& path : {beside_file, beside_key}) {
    if (fs::exists(path, error)) return path.string();
  }
  robot.Fail("urdf",
             fmt::format("= \"{}\": there is no such file: {}{}", name, beside_file.string(),
                         beside_key == beside_file ? "" : ", " + beside_key.string()));
}

UrdfModel LoadUrdf(const std::string& file, const std::vector<std::string>& fixed) {
  return ModelReader(file, fixed).Read();
}

}  // namespace plumb
