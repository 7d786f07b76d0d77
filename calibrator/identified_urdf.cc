#include "calibrator/identified_urdf.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>
#include <stdexcept>

#include "common/atomic_file.h"
#include "common/config.h"
#include "robot/urdf.h"
#include "robot/xml_edits.h"
#include "sim/model.h"

namespace plumb {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Numbers this close, relative to the largest of their kind, differ by rounding only: the text's stays.
constexpr double kRounding = 1e-14;

std::vector<double> Numbers(const TiXmlElement* element, const char* attribute, size_t count) {
  std::vector<double> numbers(count, 0);
  const char* at = element ? element->Attribute(attribute) : nullptr;
  for (size_t i = 0; at && i < count; ++i) {
    char* end = nullptr;
    numbers[i] = std::strtod(at, &end);
    at = end;
  }
  return numbers;
}

Vector3d Vector(const TiXmlElement* element, const char* attribute) {
  return Vector3d(Numbers(element, attribute, 3).data());
}

Matrix3d Rotation(const TiXmlElement* origin) {
  const Vector3d rpy = Vector(origin, "rpy");
  return (Eigen::AngleAxisd(rpy.z(), Vector3d::UnitZ()) * Eigen::AngleAxisd(rpy.y(), Vector3d::UnitY()) *
          Eigen::AngleAxisd(rpy.x(), Vector3d::UnitX()))
      .toRotationMatrix();
}

const TiXmlElement* Named(const TiXmlElement& root, const char* kind, const std::string& name) {
  const TiXmlElement* element = root.FirstChildElement(kind);
  while (element && name != element->Attribute("name")) element = element->NextSiblingElement(kind);
  return element;
}

/// A URDF link in the link of ours that it is welded to.
struct Body {
  const TiXmlElement* link;
  Vector3d at;    // of its frame, as the file has it
  Matrix3d axes;  // of its frame
  double mass() const {
    const TiXmlElement* inertial = link->FirstChildElement("inertial");
    return inertial ? Numbers(inertial->FirstChildElement("mass"), "value", 1)[0] : 0;
  }
};

class Writer {
 public:
  Writer(const std::string& text, const UrdfModel& file, const RobotDescription& now)
      : edits_(text), file_(file), now_(now) {}

  /// A link of ours, whose length is `stretch` times what it was.
  void WriteLink(size_t index, double stretch) {
    const LinkDescription &was = file_.links[index], &is = now_.links[index];
    const TiXmlElement* link = Named(edits_.root(), "link", is.name);
    if (!link) return;  // a part of a planar or floating joint
    bodies_.clear();
    Collect({link, Vector3d::Zero(), Matrix3d::Identity()});
    if (stretch != 1) Stretch(stretch);
    const auto same = [](const auto& a, const auto& b) {
      return (a - b).cwiseAbs().maxCoeff() <= kRounding * b.cwiseAbs().maxCoeff();
    };
    if (std::abs(was.mass - is.mass) > kRounding * was.mass || !same(is.center_of_mass, was.center_of_mass) ||
        !same(is.inertia, was.inertia)) {
      WriteInertials(is, stretch);
    }
  }

  /// `attribute` of a joint's <dynamics>.
  void WriteDynamics(const std::string& joint, const char* attribute, double value) {
    const TiXmlElement& element = *Named(edits_.root(), "joint", joint);
    if (const TiXmlElement* dynamics = element.FirstChildElement("dynamics")) {
      Set(*dynamics, attribute, {value}, 0);
    } else {
      added_dynamics_[joint] += fmt::format(" {}=\"{}\"", attribute, value);
    }
  }

  void AddComment(const std::string& words) { edits_.AddComment(words); }

  std::string Print() {
    for (const auto& [joint, attributes] : added_dynamics_) {
      edits_.AddChild(*Named(edits_.root(), "joint", joint), "<dynamics" + attributes + "/>");
    }
    added_dynamics_.clear();
    return edits_.Print();
  }

 private:
  // The body, and what is welded to it.
  void Collect(const Body& body) {
    bodies_.push_back(body);
    ForEachJoint(*body.link, [&](const TiXmlElement& joint) {
      if (std::string(joint.Attribute("type")) != "fixed") return;
      const TiXmlElement* origin = joint.FirstChildElement("origin");
      const char* child = joint.FirstChildElement("child")->Attribute("link");
      Collect({Named(edits_.root(), "link", child), body.at + body.axes * Vector(origin, "xyz"),
               body.axes * Rotation(origin)});
    });
  }

  template <class Function>
  void ForEachJoint(const TiXmlElement& parent, const Function& function) const {
    const std::string name = parent.Attribute("name");
    for (const TiXmlElement* j = edits_.root().FirstChildElement("joint"); j;
         j = j->NextSiblingElement("joint")) {
      if (name == j->FirstChildElement("parent")->Attribute("link")) function(*j);
    }
  }

  // Numbers of an attribute; those that the text has already, up to rounding in units of `scale`, stay as
  // they are.
  void Set(const TiXmlElement& element, const char* attribute, const std::vector<double>& values,
           double scale) {
    std::vector<double> numbers = Numbers(&element, attribute, values.size());
    bool changed = false;
    for (size_t i = 0; i < values.size(); ++i) {
      if (std::abs(values[i] - numbers[i]) <= kRounding * scale) continue;
      numbers[i] = values[i];
      changed = true;
    }
    if (changed) edits_.SetAttribute(element, attribute, fmt::format("{}", fmt::join(numbers, " ")));
  }

  void SetPosition(const TiXmlElement& parent, const Vector3d& position) {
    const double scale = position.cwiseAbs().maxCoeff();
    if (const TiXmlElement* origin = parent.FirstChildElement("origin")) {
      Set(*origin, "xyz", {position.x(), position.y(), position.z()}, scale);
    } else if (scale > 0) {
      edits_.AddChild(parent,
                      fmt::format("<origin xyz=\"{} {} {}\"/>", position.x(), position.y(), position.z()));
    }
  }

  // All positions in the link, of what is fixed to it and of the joints that it carries; and the sizes of its
  // solids.
  void Stretch(double factor) {
    const auto move = [&](const TiXmlElement& parent) {
      SetPosition(parent, factor * Vector(parent.FirstChildElement("origin"), "xyz"));
    };
    for (const Body& body : bodies_) {
      ForEachJoint(*body.link, move);
      for (const char* kind : {"visual", "collision"}) {
        for (const TiXmlElement* e = body.link->FirstChildElement(kind); e; e = e->NextSiblingElement(kind)) {
          move(*e);
          StretchSolid(*e->FirstChildElement("geometry")->FirstChildElement(), factor);
        }
      }
    }
  }

  // As the simulator does: a box grows as a whole, capsules and cylinders keep their radius.
  void StretchSolid(const TiXmlElement& solid, double factor) {
    const std::string type = solid.Value();
    const auto scale = [&](const char* attribute, size_t count) {
      std::vector<double> sizes = Numbers(&solid, attribute, count);
      for (double& size : sizes) size *= factor;
      Set(solid, attribute, sizes, 0);
    };
    if (type == "box") scale("size", 3);
    if (type == "cylinder" || type == "capsule") scale("length", 1);
  }

  // The link's mass, into the first body that has any.
  void WriteInertials(const LinkDescription& link, double stretch) {
    bool written = false;
    for (const Body& body : bodies_) {
      if (!(body.mass() > 0)) continue;
      const TiXmlElement& inertial = *body.link->FirstChildElement("inertial");
      const TiXmlElement* origin = inertial.FirstChildElement("origin");
      Matrix3d inertia = Matrix3d::Zero();
      if (!written) {
        const Matrix3d axes = body.axes * Rotation(origin);
        inertia = axes.transpose() * link.inertia * axes;
        SetPosition(inertial, body.axes.transpose() * (link.center_of_mass - stretch * body.at));
      }
      const double mass = written ? 0 : link.mass;
      Set(*inertial.FirstChildElement("mass"), "value", {mass}, mass);
      WriteInertia(*inertial.FirstChildElement("inertia"), inertia);
      written = true;
    }
  }

  void WriteInertia(const TiXmlElement& element, const Matrix3d& inertia) {
    constexpr const char* kAxes = "xyz";
    for (int i = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j) {
        const std::string attribute = {'i', kAxes[i], kAxes[j]};
        Set(element, attribute.c_str(), {inertia(i, j)}, inertia.cwiseAbs().maxCoeff());
      }
    }
  }

  XmlEdits edits_;
  const UrdfModel& file_;
  const RobotDescription& now_;
  std::vector<Body> bodies_;  // of the link at hand
  std::map<std::string, std::string> added_dynamics_;
};

/// What robot.toml says that matters here.
struct Toml {
  std::string urdf;                // path
  std::set<std::string> dynamics;  // "damping/<joint>" where it overrides the URDF's
};

Toml ReadToml(const RobotDescription& robot) {
  Config root = Config::Load(robot.file);
  Toml toml;
  toml.urdf = (std::filesystem::path(robot.file).parent_path() / root.Table("robot").String("urdf")).string();
  for (Config& joint : root.Tables("joint")) {
    const std::string name = joint.String("name");
    const Config dynamics = joint.Table("dynamics", false);
    for (const char* key : {"damping", "friction"}) {
      if (dynamics.Has(key)) toml.dynamics.insert(std::string(key) + "/" + name);
    }
  }
  return toml;
}

/// A parameter's value, and where it goes.
struct Value {
  std::string name, unit;
  double mean;
  double sd;  // NaN for a frozen one
  bool in_urdf;
};

class Placement {
 public:
  Placement(const Toml& toml, const UrdfModel& file) : toml_(toml), file_(file) {}

  bool InUrdf(const std::string& name) const {
    for (const char* kind : {"mass/", "com/", "inertia/", "length/"}) {
      if (name.starts_with(kind)) return true;
    }
    return (name.starts_with("damping/") || name.starts_with("friction/")) && InDynamics(name);
  }

 private:
  // The parts of a planar or floating joint share one <dynamics>.
  bool InDynamics(const std::string& name) const {
    const std::string joint = name.substr(name.find('/') + 1);
    const auto found = std::find_if(file_.joints.begin(), file_.joints.end(),
                                    [&](const auto& j) { return j.name == joint; });
    return found != file_.joints.end() && !file_.part[static_cast<size_t>(found - file_.joints.begin())] &&
           toml_.dynamics.count(name) == 0;
  }

  const Toml& toml_;
  const UrdfModel& file_;
};

std::vector<Value> AllValues(const RobotDescription& robot, const Eigen::VectorXd& mean,
                             const Eigen::VectorXd& sd, const Placement& placement) {
  std::vector<Value> values;
  for (size_t i = 0; i < robot.parameters.size(); ++i) {
    const ParameterDescription& p = robot.parameters[i];
    const auto k = static_cast<Eigen::Index>(i);
    values.push_back({p.name, p.unit, mean(k), sd(k), placement.InUrdf(p.name)});
  }
  for (const FrozenParameter& f : robot.frozen)
    values.push_back({f.name, "", f.value, NAN, placement.InUrdf(f.name)});
  return values;
}

// How much longer a link gets: see length/ in sim/parameters.h.
double StretchOf(const UrdfModel& file, size_t link, const std::vector<Value>& values) {
  const auto value = std::find_if(values.begin(), values.end(), [&](const Value& v) {
    return v.name == "length/" + file.links[link].name;
  });
  if (value == values.end()) return 1;
  const auto child = std::find_if(file.joints.begin(), file.joints.end(),
                                  [&](const auto& joint) { return joint.parent == static_cast<int>(link); });
  const double length =
      child == file.joints.end() ? 2 * file.links[link].center_of_mass.norm() : child->origin.norm();
  return value->mean / length;
}

std::string Quoted(const std::string& text) {
  std::string quoted;
  for (const char c : text) quoted += (c == '"' || c == '\\' ? "\\" : "") + std::string(1, c);
  return '"' + quoted + '"';
}

std::string Comment(const RobotDescription& robot, const std::vector<Value>& values) {
  std::string here, elsewhere;
  for (const Value& v : values) {
    const std::string unit = v.unit.empty() ? "" : " " + v.unit;
    const std::string sd = std::isnan(v.sd) ? "frozen" : fmt::format("sd {:.3g}{}", v.sd, unit);
    if (v.in_urdf) {
      here += fmt::format("\n       {} = {:.6g}{}, {}", v.name, v.mean, unit, sd);
    } else if (!std::isnan(v.sd)) {  // robot.toml has the frozen ones already
      elsewhere += fmt::format(
          "\n       [[parameter]]  # {}\n       name = {}\n       frozen = true\n       mean = {}", sd,
          Quoted(v.name), v.mean);
    }
  }
  std::string words = "Identified by Plumbline from the motion of " + robot.name + ".";
  words += here.empty() ? "\n     Nothing of it is in this file." : "\n     In this file:" + here;
  if (!here.empty()) words += "\n     robot.toml needs no [[parameter]] of these names any more.";
  if (!elsewhere.empty()) {
    words += "\n     Not in this file, but for robot.toml in place of its [[parameter]] of the same name:" +
             elsewhere;
  }
  return words + "\n    ";
}

}  // namespace

std::string IdentifiedUrdf(const RobotDescription& robot, const Eigen::VectorXd& mean,
                           const Eigen::VectorXd& sd) {
  if (sd.size() != mean.size())
    throw std::invalid_argument("as many standard deviations as means are needed");
  const RobotDescription now = Model(robot).Describe(mean);
  if (LoadRobot(robot.file).fingerprint != robot.fingerprint) {
    throw ConfigError(robot.file + ": it or its URDF has changed since the robot was read");
  }
  const Toml toml = ReadToml(robot);
  const UrdfModel file = LoadUrdf(toml.urdf);
  const std::vector<Value> values = AllValues(robot, mean, sd, Placement(toml, file));
  Writer writer(ReadFile(toml.urdf), file, now);
  for (size_t i = 1; i < file.links.size(); ++i) writer.WriteLink(i, StretchOf(file, i, values));
  for (const Value& v : values) {
    const size_t slash = v.name.find('/');
    const std::string kind = v.name.substr(0, slash);
    if (v.in_urdf && (kind == "damping" || kind == "friction")) {
      writer.WriteDynamics(v.name.substr(slash + 1), kind.c_str(), v.mean);
    }
  }
  writer.AddComment(Comment(robot, values));
  return writer.Print();
}

void WriteIdentifiedUrdf(const std::filesystem::path& file, const RobotDescription& robot,
                         const Eigen::VectorXd& mean, const Eigen::VectorXd& sd) {
  WriteAtomically(file, IdentifiedUrdf(robot, mean, sd));
}

}  // namespace plumb
