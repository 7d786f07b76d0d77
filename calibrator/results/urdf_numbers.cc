#include "calibrator/results/urdf_numbers.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Core>
#include <cmath>
#include <cstdlib>

#include "robot/roll_pitch_yaw.h"

namespace plumb {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// Numbers this close, relative to the largest of their kind, differ by rounding only: the text's
// stays.
constexpr double kRelativeRounding = 1e-14;

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
  return FromRollPitchYaw(Vector(origin, "rpy")).toRotationMatrix();
}

const TiXmlElement* Named(const TiXmlElement& root, const char* kind, const std::string& name) {
  const TiXmlElement* element = root.FirstChildElement(kind);
  while (element && name != element->Attribute("name")) element = element->NextSiblingElement(kind);
  return element;
}

}  // namespace

double UrdfNumbers::Body::mass() const {
  const TiXmlElement* inertial = link->FirstChildElement("inertial");
  return inertial ? Numbers(inertial->FirstChildElement("mass"), "value", 1)[0] : 0;
}

UrdfNumbers::UrdfNumbers(const std::string& text, const UrdfModel& file,
                         const RobotDescription& now)
    : edits_(text), file_(file), now_(now) {}

void UrdfNumbers::WriteLink(size_t index, double stretch) {
  const LinkDescription &was = file_.links[index], &is = now_.links[index];
  const TiXmlElement* link = Named(edits_.root(), "link", is.name);
  if (!link) return;  // a part of a planar or floating joint
  bodies_.clear();
  Collect({link, Vector3d::Zero(), Matrix3d::Identity()});
  if (stretch != 1) Stretch(stretch);
  const auto same = [](const auto& a, const auto& b) {
    return (a - b).cwiseAbs().maxCoeff() <= kRelativeRounding * b.cwiseAbs().maxCoeff();
  };
  if (std::abs(was.mass - is.mass) > kRelativeRounding * was.mass ||
      !same(is.center_of_mass, was.center_of_mass) || !same(is.inertia, was.inertia)) {
    WriteInertials(is, stretch);
  }
}

void UrdfNumbers::WriteDynamics(const std::string& joint, const char* attribute, double value) {
  const TiXmlElement& element = *Named(edits_.root(), "joint", joint);
  if (const TiXmlElement* dynamics = element.FirstChildElement("dynamics")) {
    Set(*dynamics, attribute, {value}, 0);
  } else {
    added_dynamics_[joint] += fmt::format(" {}=\"{}\"", attribute, value);
  }
}

std::string UrdfNumbers::Print() {
  for (const auto& [joint, attributes] : added_dynamics_) {
    edits_.AddChild(*Named(edits_.root(), "joint", joint), "<dynamics" + attributes + "/>");
  }
  added_dynamics_.clear();
  return edits_.Print();
}

// The body, and what is welded to it.
void UrdfNumbers::Collect(const Body& body) {
  bodies_.push_back(body);
  ForEachJoint(*body.link, [&](const TiXmlElement& joint) {
    if (std::string(joint.Attribute("type")) != "fixed") return;
    const TiXmlElement* origin = joint.FirstChildElement("origin");
    const char* child = joint.FirstChildElement("child")->Attribute("link");
    Collect({Named(edits_.root(), "link", child), body.at + body.axes * Vector(origin, "xyz"),
             body.axes * Rotation(origin)});
  });
}

void UrdfNumbers::ForEachJoint(const TiXmlElement& parent,
                               const std::function<void(const TiXmlElement&)>& function) const {
  const std::string name = parent.Attribute("name");
  for (const TiXmlElement* j = edits_.root().FirstChildElement("joint"); j;
       j = j->NextSiblingElement("joint")) {
    if (name == j->FirstChildElement("parent")->Attribute("link")) function(*j);
  }
}

// Numbers of an attribute; those that the text has already, up to rounding in units of `scale`,
// stay as they are.
void UrdfNumbers::Set(const TiXmlElement& element, const char* attribute,
                      const std::vector<double>& values, double scale) {
  std::vector<double> numbers = Numbers(&element, attribute, values.size());
  bool changed = false;
  for (size_t i = 0; i < values.size(); ++i) {
    if (std::abs(values[i] - numbers[i]) <= kRelativeRounding * scale) continue;
    numbers[i] = values[i];
    changed = true;
  }
  if (changed) edits_.SetAttribute(element, attribute, fmt::format("{}", fmt::join(numbers, " ")));
}

void UrdfNumbers::SetPosition(const TiXmlElement& parent, const Vector3d& position) {
  const double scale = position.cwiseAbs().maxCoeff();
  if (const TiXmlElement* origin = parent.FirstChildElement("origin")) {
    Set(*origin, "xyz", {position.x(), position.y(), position.z()}, scale);
  } else if (scale > 0) {
    edits_.AddChild(parent, fmt::format("<origin xyz=\"{} {} {}\"/>", position.x(), position.y(),
                                        position.z()));
  }
}

// All positions in the link, of what is fixed to it and of the joints that it carries; and the
// sizes of its solids.
void UrdfNumbers::Stretch(double factor) {
  const auto move = [&](const TiXmlElement& parent) {
    SetPosition(parent, factor * Vector(parent.FirstChildElement("origin"), "xyz"));
  };
  for (const Body& body : bodies_) {
    ForEachJoint(*body.link, move);
    for (const char* kind : {"visual", "collision"}) {
      for (const TiXmlElement* e = body.link->FirstChildElement(kind); e;
           e = e->NextSiblingElement(kind)) {
        move(*e);
        StretchSolid(*e->FirstChildElement("geometry")->FirstChildElement(), factor);
      }
    }
  }
}

// As the simulator does: a box grows as a whole, capsules and cylinders keep their radius.
void UrdfNumbers::StretchSolid(const TiXmlElement& solid, double factor) {
  const std::string type = solid.Value();
  const auto scale = [&](const char* attribute, size_t count) {
    std::vector<double> sizes = Numbers(&solid, attribute, count);
    for (double& size : sizes) size *= factor;
    Set(solid, attribute, sizes, 0);
  };
  if (type == "box") scale("size", 3);
  if (type == "cylinder" || type == "capsule") scale("length", 1);
  if (type == "mesh") {
    const Vector3d old = solid.Attribute("scale") ? Vector(&solid, "scale") : Vector3d::Ones();
    Set(solid, "scale", {factor * old.x(), factor * old.y(), factor * old.z()}, 0);
  }
}

// The link's mass, into the first body that has any.
void UrdfNumbers::WriteInertials(const LinkDescription& link, double stretch) {
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

void UrdfNumbers::WriteInertia(const TiXmlElement& element, const Matrix3d& inertia) {
  constexpr const char* kAxes = "xyz";
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j) {
      const std::string attribute = {'i', kAxes[i], kAxes[j]};
      Set(element, attribute.c_str(), {inertia(i, j)}, inertia.cwiseAbs().maxCoeff());
    }
  }
}

}  // namespace plumb
