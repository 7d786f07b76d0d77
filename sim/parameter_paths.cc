#include "sim/parameter_paths.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "common/nearest_name.h"
#include "robot/place_in_file.h"

namespace plumb {
namespace {

using Eigen::Vector3d;
using Number = LinkParameterKind::Number;

// To the first further joint of the link that joint `index` moves; a link that carries none is a
// uniform rod.
double LengthOf(const RobotDescription& description, size_t index, const Physics<double>& physics) {
  const auto& joints = description.joints;
  const auto child = std::find_if(joints.begin(), joints.end(), [&](const auto& joint) {
    return joint.parent == static_cast<int>(index) + 1;
  });
  if (child == joints.end()) return 2 * description.links[index + 1].center_of_mass.norm();
  return Vector3d::Map(physics.links[static_cast<size_t>(child - joints.begin())].origin).norm();
}

std::string Where(const std::string& name, const RobotDescription& description) {
  const std::string place = PlaceInFile(description, "parameter", name, "name");
  return place.empty() ? "" : place + "[[parameter]]: ";
}

// "tool is fixed to wand: use mass/wand", of mass/tool or com/tool/x; empty if nothing is.
std::string FixedTo(const std::vector<std::string>& names, const std::string& name,
                    const RobotDescription& description) {
  const size_t slash = std::min(name.find('/'), name.size());
  const std::string kind = name.substr(0, slash), rest = name.substr(slash);
  for (const LinkDescription& link : description.links) {
    for (const FixedLink& part : link.fixed) {
      const std::string whole = "/" + part.link;
      if (rest == "/" + part.joint && rest != whole) return part.joint + " is a fixed joint";
      if (rest != whole && !rest.starts_with(whole + "/")) continue;
      const std::string instead = kind + "/" + link.name + rest.substr(whole.size());
      const bool there = std::ranges::find(names, instead) != names.end();
      return part.link + " is fixed to " + link.name + (there ? ": use " + instead : "");
    }
  }
  return "";
}

std::string NoParameter(const std::vector<ParameterPath>& paths, const std::string& name,
                        const RobotDescription& description) {
  std::vector<std::string> names;
  names.reserve(paths.size());
  for (const ParameterPath& path : paths) names.push_back(path.path);
  const std::string what = "the simulator has no parameter '" + name + "'",
                    fixed = FixedTo(names, name, description);
  if (!fixed.empty()) return what + ": " + fixed;
  std::string why;
  if (name.starts_with("contact/"))
    why = " (contact needs [simulation.contact] and collision shapes)";
  if (name.starts_with("limit/")) why = " (stops need [simulation.limit])";
  if (name.starts_with("length/"))
    why = " (a link whose joints and centre of mass coincide has no length)";
  return what + why + "; the nearest is '" + NearestName(name, names) + "'";
}

}  // namespace

std::vector<ParameterPath> ParameterPaths(const RobotDescription& description,
                                          const Physics<double>& physics) {
  std::vector<ParameterPath> paths;
  for (const WorldParameterKind& kind : kWorldParameterKinds) {
    if (!description.simulation.Has(kind.table)) continue;
    paths.push_back({.path = kind.name, .values = kind.values, .world = &kind});
  }
  paths.push_back({.path = "mass/" + description.links[0].name, .values = kAboveZero});
  size_t velocity = 0;
  for (size_t i = 0; i < description.joints.size(); ++i) {
    const LinkDescription& link = description.links[i + 1];
    const double mass = physics.links[i].mass, length = LengthOf(description, i, physics);
    for (const LinkParameterKind& kind : kLinkParameterKinds) {
      const bool is_length = kind.number == Number::kLength;
      if (!((is_length ? length : mass) > 0)) continue;
      const std::string entry = *kind.entry ? std::string("/") + kind.entry : "";
      const double reference = is_length ? length : kind.number == Number::kMass ? mass : 1;
      paths.push_back({.path = std::string(kind.name) + "/" + link.name + entry,
                       .values = kind.values,
                       .link = &kind,
                       .index = i,
                       .reference = reference});
    }
    const JointDescription& joint = description.joints[i];
    const auto count = static_cast<size_t>(joint.num_velocities());
    for (const JointParameterKind& kind : kJointParameterKinds) {
      if (!joint.IsOf(kind.joints)) continue;
      paths.push_back({.path = std::string(kind.name) + "/" + joint.name,
                       .values = kind.values,
                       .joint = &kind,
                       .index = velocity,
                       .count = count});
    }
    velocity += count;
  }
  return paths;
}

std::vector<ParameterPath> FindPaths(const std::vector<ParameterPath>& paths,
                                     const std::string& name, const std::set<std::string>& named,
                                     const RobotDescription& description) {
  std::vector<ParameterPath> found;
  for (const ParameterPath& candidate : paths) {
    if (candidate.path == name) return {candidate};
    if (candidate.effective() && Covers(name, candidate.path) && !named.contains(candidate.path))
      found.push_back(candidate);
  }
  for (const ParameterPath& path : found) {
    if (path.world != found[0].world || path.joint != found[0].joint ||
        path.link != found[0].link) {
      throw std::invalid_argument(fmt::format("{}'{}' is '{}' and '{}': one number cannot be both",
                                              Where(name, description), name, found[0].path,
                                              path.path));
    }
  }
  if (found.empty())
    throw std::invalid_argument(Where(name, description) + NoParameter(paths, name, description));
  return found;
}

}  // namespace plumb
