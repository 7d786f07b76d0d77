#include "robot/urdf/elements.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "robot/urdf/xml.h"

namespace plumb {
namespace {

// Beyond these a number is a mistake, and the simulator's would overflow.
constexpr double kSane = 1e9, kSaneLimit = 1e18;
constexpr size_t kMaxLinks = 1000;

Eigen::Vector3d ToVector(const std::vector<double>& numbers) {
  return Eigen::Vector3d(numbers.data());
}

// As FromRollPitchYaw, but to the last bit as ROS's urdfdom has it, then normalised again as Eigen
// does: what is known of a robot by its fingerprint depends on it.
Eigen::Matrix3d UrdfdomRotation(const Eigen::Vector3d& rpy) {
  const double sx = std::sin(rpy.x() / 2), sy = std::sin(rpy.y() / 2), sz = std::sin(rpy.z() / 2);
  const double cx = std::cos(rpy.x() / 2), cy = std::cos(rpy.y() / 2), cz = std::cos(rpy.z() / 2);
  const double x = sx * cy * cz - cx * sy * sz, y = cx * sy * cz + sx * cy * sz,
               z = cx * cy * sz - sx * sy * cz, w = cx * cy * cz + sx * sy * sz;
  const double norm = std::sqrt(x * x + y * y + z * z + w * w);
  return Eigen::Quaterniond(w / norm, x / norm, y / norm, z / norm).normalized().toRotationMatrix();
}

class ElementReader {
 public:
  ElementReader(const std::string& text, const std::string& file) : xml_(text, file) {}

  UrdfElements Read() {
    const TiXmlElement& robot = xml_.root();
    if (robot.ValueStr() != "robot")
      xml_.Fail(robot, fmt::format("<{}> is not a <robot>", robot.ValueStr().substr(0, 80)));
    result_.name = xml_.Name(robot, "name");
    result_.line = robot.Row();
    CheckChildren(robot, {"link", "joint"}, {"material", "transmission", "gazebo", "sensor"});
    for (const TiXmlElement* e = robot.FirstChildElement("link"); e;
         e = e->NextSiblingElement("link"))
      ReadLink(*e);
    if (result_.links.empty()) xml_.Fail(robot, "has no <link>");
    for (const TiXmlElement* e = robot.FirstChildElement("joint"); e;
         e = e->NextSiblingElement("joint"))
      ReadJoint(*e);
    CheckTree();
    return std::move(result_);
  }

 private:
  using Pose = UrdfElements::Pose;

  // Warns of children that are not `known`. `silent` are those that tell other programs something.
  void CheckChildren(const TiXmlElement& parent, std::initializer_list<const char*> known,
                     std::initializer_list<const char*> silent = {}) {
    for (const std::string& other : xml_.Others(parent, known)) {
      if (std::none_of(silent.begin(), silent.end(), [&](const char* name) {
            return other.find(fmt::format(": <{}> in ", name)) != std::string::npos;
          })) {
        result_.warnings.push_back(other + " is not known and has no effect");
      }
    }
  }

  Pose ReadOrigin(const TiXmlElement& parent) {
    Pose pose;
    const TiXmlElement* origin = xml_.Child(parent, "origin");
    if (!origin) return pose;
    if (origin->Attribute("xyz")) pose.at = ToVector(xml_.Numbers(*origin, "xyz", 3, kSane));
    if (origin->Attribute("rpy"))
      pose.axes = UrdfdomRotation(ToVector(xml_.Numbers(*origin, "rpy", 3, kSane)));
    return pose;
  }

  void ReadLink(const TiXmlElement& element) {
    const std::string name = xml_.Name(element, "name");
    UrdfElements::Link link;
    link.line = element.Row();
    if (result_.links.size() == kMaxLinks)
      xml_.Fail(element, fmt::format("more than {} links", kMaxLinks));
    CheckChildren(element, {"inertial", "visual", "collision"}, {"sensor", "gazebo"});
    if (const TiXmlElement* inertial = xml_.Child(element, "inertial"))
      link.inertial = ReadInertial(*inertial, name);
    link.visuals = ReadSolids(element, "visual", nullptr);
    link.collisions = ReadSolids(element, "collision", &link.collision_meshes);
    if (!result_.links.emplace(name, std::move(link)).second) {
      xml_.Fail(element, fmt::format("a second link is called {}", name));
    }
  }

  UrdfElements::Inertial ReadInertial(const TiXmlElement& element, const std::string& link) {
    CheckChildren(element, {"origin", "mass", "inertia"});
    UrdfElements::Inertial inertial;
    inertial.line = element.Row();
    inertial.origin = ReadOrigin(element);
    const TiXmlElement& mass = xml_.RequiredChild(element, "mass");
    inertial.mass = xml_.Number(mass, "value", kSane);
    if (inertial.mass < 0) xml_.Fail(mass, fmt::format("link {}: mass must not be negative", link));
    const TiXmlElement& inertia = xml_.RequiredChild(element, "inertia");
    for (int i = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j) {
        const std::string entry = {'i', "xyz"[i], "xyz"[j]};
        inertial.inertia(i, j) = inertial.inertia(j, i) =
            xml_.Number(inertia, entry.c_str(), kSane);
      }
    }
    return inertial;
  }

  std::vector<UrdfElements::Solid> ReadSolids(const TiXmlElement& link, const char* kind,
                                              std::vector<UrdfElements::Mesh>* meshes) {
    std::vector<UrdfElements::Solid> solids;
    for (const TiXmlElement* e = link.FirstChildElement(kind); e; e = e->NextSiblingElement(kind)) {
      CheckChildren(*e, {"origin", "geometry"}, {"material", "verbose", "contact"});
      const Pose origin = ReadOrigin(*e);
      const TiXmlElement& geometry = xml_.RequiredChild(*e, "geometry");
      const TiXmlElement* solid = geometry.FirstChildElement();
      if (!solid) xml_.Fail(geometry, "<geometry> is empty");
      if (solid->NextSiblingElement())
        xml_.Fail(*solid->NextSiblingElement(), "a second solid in <geometry>");
      if (solid->ValueStr() != "mesh") {
        solids.push_back({solid->Row(), ReadSolid(*solid, origin)});
      } else if (meshes) {
        meshes->push_back(ReadMesh(*solid, origin));
      }
    }
    return solids;
  }

  UrdfElements::Mesh ReadMesh(const TiXmlElement& mesh, const Pose& origin) {
    UrdfElements::Mesh read{mesh.Row(), origin, xml_.Name(mesh, "filename")};
    if (mesh.Attribute("scale")) read.scale = ToVector(xml_.Numbers(mesh, "scale", 3, kSane));
    return read;
  }

  Shape ReadSolid(const TiXmlElement& solid, const Pose& origin) {
    Shape shape{Shape::Type::kSphere, origin.at, origin.axes};
    const std::string type = solid.ValueStr();
    const auto positive = [&](const char* attribute, int at, int count) {
      const std::vector<double> sizes =
          xml_.Numbers(solid, attribute, static_cast<size_t>(count), kSane);
      for (int i = 0; i < count; ++i) {
        shape.size(at + i) = sizes[static_cast<size_t>(i)];
        if (!(shape.size(at + i) > 0))
          xml_.Fail(solid, fmt::format("{} of <{}> must be positive", attribute, type));
      }
    };
    if (type == "box") {
      shape.type = Shape::Type::kBox;
      positive("size", 0, 3);
    } else if (type == "sphere") {
      positive("radius", 0, 1);
    } else if (type == "cylinder" || type == "capsule") {
      shape.type = type == "capsule" ? Shape::Type::kCapsule : Shape::Type::kCylinder;
      positive("radius", 0, 1);
      positive("length", 1, 1);
    } else {
      xml_.Fail(solid, fmt::format("<{}> is not one of box, sphere, cylinder, capsule, mesh",
                                   type.substr(0, 80)));
    }
    return shape;
  }

  void ReadJoint(const TiXmlElement& element) {
    const std::string name = xml_.Name(element, "name");
    const std::string label = "joint " + name;
    UrdfElements::Joint joint;
    joint.line = joint.limit_line = joint.axis_line = element.Row();
    joint.type = xml_.Name(element, "type");
    constexpr std::array kTypes{"fixed",     "revolute", "continuous",
                                "prismatic", "planar",   "floating"};
    if (std::find(kTypes.begin(), kTypes.end(), joint.type) == kTypes.end()) {
      xml_.Fail(element,
                label + " is not fixed, revolute, continuous, prismatic, planar or floating");
    }
    if (const TiXmlElement* mimic = element.FirstChildElement("mimic")) {
      xml_.Fail(*mimic, label + " is to mimic another: coupled joints are not simulated");
    }
    CheckChildren(element, {"parent", "child", "origin", "axis", "limit", "dynamics"},
                  {"calibration", "safety_controller", "gazebo"});
    joint.origin = ReadOrigin(element);
    if (const TiXmlElement* axis = xml_.Child(element, "axis")) {
      joint.axis_line = axis->Row();
      joint.axis = ToVector(xml_.Numbers(*axis, "xyz", 3, kSane));
    }
    ReadLimit(element, label, joint);
    if (const TiXmlElement* dynamics = xml_.Child(element, "dynamics")) {
      for (const auto& [attribute, value] :
           {std::pair{"damping", &joint.damping}, {"friction", &joint.friction}}) {
        if (dynamics->Attribute(attribute)) *value = xml_.Number(*dynamics, attribute, kSane);
        if (*value < 0)
          xml_.Fail(*dynamics, fmt::format("{}: {} must not be negative", label, attribute));
      }
    }
    const std::string parent = xml_.Name(xml_.RequiredChild(element, "parent"), "link");
    const std::string child = joint.child = xml_.Name(xml_.RequiredChild(element, "child"), "link");
    for (const std::string& link : {parent, child}) {
      if (!result_.links.count(link))
        xml_.Fail(element, fmt::format("{}: there is no link {}", label, link));
    }
    if (!result_.joints.emplace(name, joint).second) {
      xml_.Fail(element, fmt::format("a second joint is called {}", name));
    }
    if (!joint_of_.emplace(child, name).second) {
      xml_.Fail(element, fmt::format("link {} is moved by joint {} and by joint {}", child,
                                     joint_of_[child], name));
    }
    result_.links.at(parent).joints.push_back(name);
  }

  void ReadLimit(const TiXmlElement& element, const std::string& label,
                 UrdfElements::Joint& joint) {
    const TiXmlElement* limit = xml_.Child(element, "limit");
    if (!limit) {
      if (joint.type == "revolute" || joint.type == "prismatic")
        xml_.Fail(element, label + " has no <limit>");
      return;
    }
    joint.limit_line = limit->Row();
    const auto read = [&](const char* attribute, double& value, double magnitude) {
      if (limit->Attribute(attribute)) value = xml_.Number(*limit, attribute, magnitude);
    };
    read("lower", joint.lower, kSaneLimit);
    read("upper", joint.upper, kSaneLimit);
    read("effort", joint.effort, kSane);
    read("velocity", joint.velocity, kSaneLimit);
    if (joint.effort < 0) xml_.Fail(*limit, label + ": limit effort must not be negative");
    if (!(joint.velocity > 0)) xml_.Fail(*limit, label + ": limit velocity must be positive");
    if ((joint.type == "revolute" || joint.type == "prismatic") && !(joint.lower < joint.upper)) {
      xml_.Fail(*limit, label + ": limit lower must be below upper");
    }
  }

  // One root, and a way from it to every link. That no link has two parents is known already.
  void CheckTree() {
    std::vector<std::string> roots;
    for (const auto& [name, link] : result_.links) {
      if (!joint_of_.count(name)) roots.push_back(name);
    }
    const auto line = [&](const std::string& link) { return result_.links.at(link).line; };
    std::sort(roots.begin(), roots.end(),
              [&](const auto& a, const auto& b) { return line(a) < line(b); });
    if (roots.size() > 1) {
      xml_.Fail(line(roots[1]),
                fmt::format("link {} hangs on no joint, nor does link {}", roots[1], roots[0]));
    }
    std::set<std::string> reached(roots.begin(), roots.end());
    for (std::vector<std::string> open = roots; !open.empty();) {
      const std::string link = open.back();
      open.pop_back();
      for (const std::string& joint : result_.links.at(link).joints) {
        reached.insert(result_.joints.at(joint).child);
        open.push_back(result_.joints.at(joint).child);
      }
    }
    for (const auto& [name, link] : result_.links) {
      if (!reached.count(name))
        xml_.Fail(link.line, fmt::format("link {} is part of a cycle of joints", name));
    }
    result_.root = roots.front();
  }

  Xml xml_;
  UrdfElements result_;
  std::map<std::string, std::string> joint_of_;  // by the link it moves
};

}  // namespace

UrdfElements ReadUrdfElements(const std::string& text, const std::string& file) {
  return ElementReader(text, file).Read();
}

}  // namespace plumb
