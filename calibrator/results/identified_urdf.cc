#include "calibrator/results/identified_urdf.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include "calibrator/results/urdf_numbers.h"
#include "common/atomic_file.h"
#include "common/config.h"
#include "robot/urdf/urdf.h"
#include "sim/model.h"

namespace plumb {
namespace {

/// The settings of robot.toml that matter here.
struct Toml {
  std::string urdf;                // path
  std::vector<std::string> fixed;  // joints
  std::set<std::string> dynamics;  // paths of what is in [joint.dynamics]
};

Toml ReadToml(const RobotDescription& robot) {
  Config root = Config::Load(robot.file);
  Toml toml;
  Config header = root.Table("robot");
  toml.urdf = FindUrdf(header);
  toml.fixed = header.Strings("fixed", std::vector<std::string>{});
  for (Config& joint : root.Tables("joint")) {
    const std::string name = joint.String("name");
    const Config dynamics = joint.Table("dynamics", false);
    for (const JointParameterKind& kind : kJointParameterKinds) {
      if (dynamics.Has(kind.key)) toml.dynamics.insert(std::string(kind.name) + "/" + name);
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
  Placement(const RobotDescription& robot, const Toml& toml, const UrdfModel& file)
      : robot_(robot), toml_(toml), file_(file) {}

  bool InUrdf(const std::string& name) const {
    const std::string kind = name.substr(0, name.find('/'));
    for (const LinkParameterKind& of_link : kLinkParameterKinds) {
      if (kind == of_link.name) return true;
    }
    for (const JointParameterKind& of_joint : kJointParameterKinds) {
      if (of_joint.in_urdf && kind == of_joint.name) return InDynamics(name);
    }
    return false;
  }

 private:
  // Of all that it gives. The parts of a planar or floating joint share one <dynamics>.
  bool InDynamics(const std::string& name) const {
    const std::string kind = name.substr(0, name.find('/') + 1);
    int here = 0, elsewhere = 0;
    for (const auto& joint : file_.joints) {
      const std::string path = kind + joint.name;
      if (robot_.ParameterOf(path) != name) continue;
      const bool other = joint.part || toml_.dynamics.contains(path);
      ++(other ? elsewhere : here);
    }
    return here > 0 && elsewhere == 0;
  }

  const RobotDescription& robot_;
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
double StretchOf(const RobotDescription& robot, const UrdfModel& file, size_t link,
                 const std::vector<Value>& values) {
  const std::string name = robot.ParameterOf("length/" + file.links[link].name);
  const auto value =
      std::find_if(values.begin(), values.end(), [&](const Value& v) { return v.name == name; });
  if (value == values.end()) return 1;
  const auto child = std::find_if(file.joints.begin(), file.joints.end(), [&](const auto& joint) {
    return joint.parent == static_cast<int>(link);
  });
  const double length = child == file.joints.end() ? 2 * file.links[link].center_of_mass.norm()
                                                   : child->origin.norm();
  return length > 0 ? value->mean / length : 1;  // "length/*" is not for links that have none
}

std::string Quoted(const std::string& text) {
  std::string quoted;
  for (const char c : text) quoted += (c == '"' || c == '\\' ? "\\" : "") + std::string(1, c);
  return '"' + quoted + '"';
}

std::string UrdfComment(const RobotDescription& robot, const std::vector<Value>& values,
                        bool residual) {
  std::string here, elsewhere;
  for (const Value& v : values) {
    const std::string unit = v.unit.empty() ? "" : " " + v.unit;
    const std::string sd = std::isnan(v.sd) ? "frozen" : fmt::format("sd {:.3g}{}", v.sd, unit);
    if (v.in_urdf) {
      here += fmt::format("\n       {} = {:.6g}{}, {}", v.name, v.mean, unit, sd);
    } else if (!std::isnan(v.sd)) {  // robot.toml has the frozen ones already
      elsewhere += fmt::format(
          "\n       [[parameter]]  # {}\n       name = {}\n       frozen = true\n       mean = {}",
          sd, Quoted(v.name), v.mean);
    }
  }
  std::string words = "Identified by Plumbline from the motion of " + robot.name + ".";
  words += here.empty() ? "\n     Nothing of it is in this file." : "\n     In this file:" + here;
  if (!here.empty()) words += "\n     robot.toml needs no [[parameter]] of these names any more.";
  if (!elsewhere.empty()) {
    words +=
        "\n     Not in this file, but for robot.toml in place of its [[parameter]] of the same "
        "name:" +
        elsewhere;
  }
  if (residual) {
    words +=
        "\n     The model does not explain the robot. What was learnt that it lacks, the residual "
        "in "
        "posterior.json,\n     is in no URDF: a simulator with this file alone errs where it "
        "stands "
        "in for it.";
  }
  return words + "\n    ";
}

}  // namespace

std::string IdentifiedUrdf(const RobotDescription& robot, const Eigen::VectorXd& mean,
                           const Eigen::VectorXd& sd, bool residual) {
  if (sd.size() != mean.size())
    throw std::invalid_argument("as many standard deviations as means are needed");
  const RobotDescription now = Model(robot).Describe(mean);
  if (LoadRobot(robot.file).fingerprint != robot.fingerprint) {
    throw ConfigError(robot.file + ": it or its URDF has changed since the robot was read");
  }
  const Toml toml = ReadToml(robot);
  const UrdfModel file = LoadUrdf(toml.urdf, toml.fixed);
  const std::vector<Value> values = AllValues(robot, mean, sd, Placement(robot, toml, file));
  UrdfNumbers writer(ReadFile(toml.urdf), file, now);
  for (size_t i = 1; i < file.links.size(); ++i)
    writer.WriteLink(i, StretchOf(robot, file, i, values));
  for (const Value& v : values) {
    for (const JointParameterKind& kind : kJointParameterKinds) {
      if (!kind.in_urdf || !v.in_urdf) continue;
      for (const auto& joint : file.joints) {
        if (robot.ParameterOf(std::string(kind.name) + "/" + joint.name) == v.name)
          writer.WriteDynamics(joint.name, kind.key, v.mean);
      }
    }
  }
  writer.AddComment(UrdfComment(robot, values, residual));
  return writer.Print();
}

void WriteIdentifiedUrdf(const std::filesystem::path& file, const RobotDescription& robot,
                         const Eigen::VectorXd& mean, const Eigen::VectorXd& sd, bool residual) {
  WriteAtomically(file, IdentifiedUrdf(robot, mean, sd, residual));
}

}  // namespace plumb
