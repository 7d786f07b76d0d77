#include "robot/urdf_xml.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>

#include "robot/xml.h"

namespace plumb {
namespace {

// Beyond these a number is a mistake, and the simulator's would overflow.
constexpr double kSane = 1e9, kSaneLimit = 1e18;
constexpr size_t kMaxLinks = 1000;

class Checker {
 public:
  Checker(const std::string& text, const std::string& file) : xml_(text, file) {}

  UrdfXml Read() {
    TiXmlElement& robot = xml_.root();
    if (robot.ValueStr() != "robot")
      xml_.Fail(robot, fmt::format("<{}> is not a <robot>", robot.ValueStr().substr(0, 80)));
    xml_.Name(robot, "name");
    result_.line = robot.Row();
    Keep(robot, {"link", "joint"}, {"material", "transmission", "gazebo", "sensor"});
    for (TiXmlElement* e = robot.FirstChildElement("link"); e; e = e->NextSiblingElement("link"))
      ReadLink(*e);
    if (result_.links.empty()) xml_.Fail(robot, "has no <link>");
    for (TiXmlElement* e = robot.FirstChildElement("joint"); e; e = e->NextSiblingElement("joint"))
      ReadJoint(*e);
    CheckTree();
    result_.text = xml_.Print();
    return std::move(result_);
  }

 private:
  // Leaves the children we read. `silent` are those that say something to other programs.
  void Keep(TiXmlElement& parent, std::initializer_list<const char*> known,
            std::initializer_list<const char*> silent = {}) {
    for (const std::string& other : xml_.RemoveOthers(parent, known)) {
      if (std::none_of(silent.begin(), silent.end(), [&](const char* name) {
            return other.find(fmt::format(": <{}> in ", name)) != std::string::npos;
          })) {
        result_.warnings.push_back(other + " is not known and has no effect");
      }
    }
  }

  void ReadOrigin(TiXmlElement& parent) {
    TiXmlElement* origin = xml_.Child(parent, "origin");
    if (!origin) return;
    for (const char* attribute : {"xyz", "rpy"}) {
      if (origin->Attribute(attribute)) xml_.Numbers(*origin, attribute, 3, kSane);
    }
  }

  void ReadLink(TiXmlElement& element) {
    const std::string name = xml_.Name(element, "name");
    UrdfXml::Link link;
    link.line = element.Row();
    if (result_.links.size() == kMaxLinks)
      xml_.Fail(element, fmt::format("more than {} links", kMaxLinks));
    Keep(element, {"inertial", "visual", "collision"}, {"sensor", "gazebo"});
    if (TiXmlElement* inertial = xml_.Child(element, "inertial")) {
      link.inertial_line = inertial->Row();
      Keep(*inertial, {"origin", "mass", "inertia"});
      ReadOrigin(*inertial);
      const double mass = xml_.Number(xml_.RequiredChild(*inertial, "mass"), "value", kSane);
      if (mass < 0)
        xml_.Fail(*xml_.Child(*inertial, "mass"),
                  fmt::format("link {}: mass must not be negative", name));
      TiXmlElement& inertia = xml_.RequiredChild(*inertial, "inertia");
      for (const char* entry : {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"})
        xml_.Number(inertia, entry, kSane);
    }
    link.visuals = ReadShapes(element, "visual", nullptr);
    link.collisions = ReadShapes(element, "collision", &link.collision_meshes);
    if (!result_.links.emplace(name, std::move(link)).second) {
      xml_.Fail(element, fmt::format("a second link is called {}", name));
    }
  }

  std::vector<UrdfXml::Shape> ReadShapes(TiXmlElement& link, const char* kind,
                                         std::vector<int>* meshes) {
    std::vector<UrdfXml::Shape> shapes;
    for (TiXmlElement *e = link.FirstChildElement(kind), *next; e; e = next) {
      next = e->NextSiblingElement(kind);
      Keep(*e, {"origin", "geometry"}, {"material", "verbose", "contact"});
      ReadOrigin(*e);
      TiXmlElement& geometry = xml_.RequiredChild(*e, "geometry");
      TiXmlElement* solid = geometry.FirstChildElement();
      if (!solid) xml_.Fail(geometry, "<geometry> is empty");
      if (solid->NextSiblingElement())
        xml_.Fail(*solid->NextSiblingElement(), "a second solid in <geometry>");
      const std::string type = solid->ValueStr();
      if (type == "mesh") {
        if (meshes) meshes->push_back(e->Row());
        link.RemoveChild(e);
        continue;
      }
      const auto positive = [&](const char* attribute, size_t count) {
        for (const double size : xml_.Numbers(*solid, attribute, count, kSane)) {
          if (!(size > 0))
            xml_.Fail(*solid, fmt::format("{} of <{}> must be positive", attribute, type));
        }
      };
      if (type == "box") {
        positive("size", 3);
      } else if (type == "sphere") {
        positive("radius", 1);
      } else if (type == "cylinder" || type == "capsule") {
        positive("radius", 1);
        positive("length", 1);
      } else {
        xml_.Fail(*solid, fmt::format("<{}> is not one of box, sphere, cylinder, capsule, mesh",
                                      type.substr(0, 80)));
      }
      shapes.push_back({solid->Row(), type == "capsule"});
      if (type == "capsule") solid->SetValue("cylinder");
    }
    return shapes;
  }

  void ReadJoint(TiXmlElement& element) {
    const std::string name = xml_.Name(element, "name");
    const std::string label = "joint " + name;
    UrdfXml::Joint joint;
    joint.line = joint.limit_line = joint.axis_line = element.Row();
    joint.order = result_.joints.size();
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
    Keep(element, {"parent", "child", "origin", "axis", "limit", "dynamics"},
         {"calibration", "safety_controller", "gazebo"});
    ReadOrigin(element);
    if (TiXmlElement* axis = xml_.Child(element, "axis")) {
      joint.axis_line = axis->Row();
      xml_.Numbers(*axis, "xyz", 3, kSane);
    }
    ReadLimit(element, label, joint);
    if (TiXmlElement* dynamics = xml_.Child(element, "dynamics")) {
      for (const auto& [attribute, value] :
           {std::pair{"damping", &joint.damping}, {"friction", &joint.friction}}) {
        if (dynamics->Attribute(attribute)) *value = xml_.Number(*dynamics, attribute, kSane);
        if (*value < 0)
          xml_.Fail(*dynamics, fmt::format("{}: {} must not be negative", label, attribute));
      }
      element.RemoveChild(dynamics);
    }
    const std::string parent = xml_.Name(xml_.RequiredChild(element, "parent"), "link");
    const std::string child = xml_.Name(xml_.RequiredChild(element, "child"), "link");
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
    children_[parent].push_back(child);
  }

  void ReadLimit(TiXmlElement& element, const std::string& label, UrdfXml::Joint& joint) {
    TiXmlElement* limit = xml_.Child(element, "limit");
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
    // urdfdom insists on both.
    for (const char* attribute : {"effort", "velocity"}) {
      if (!limit->Attribute(attribute)) limit->SetAttribute(attribute, "0");
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
      for (const std::string& child : children_[link]) {
        reached.insert(child);
        open.push_back(child);
      }
    }
    for (const auto& [name, link] : result_.links) {
      if (!reached.count(name))
        xml_.Fail(link.line, fmt::format("link {} is part of a cycle of joints", name));
    }
  }

  Xml xml_;
  UrdfXml result_;
  std::map<std::string, std::string> joint_of_;               // by the link it moves
  std::map<std::string, std::vector<std::string>> children_;  // links
};

}  // namespace

UrdfXml ReadUrdfXml(const std::string& text, const std::string& file) {
  return Checker(text, file).Read();
}

}  // namespace plumb
