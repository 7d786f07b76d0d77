#include "sim/parameter_paths.h"

#include <algorithm>
#include <stdexcept>

#include "common/nearest_name.h"

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
                                     const std::string& file) {
  const std::string where = file.empty() ? "" : file + ": [[parameter]]: ";
  std::vector<ParameterPath> found;
  std::vector<std::string> names;
  for (const ParameterPath& candidate : paths) {
    if (candidate.path == name) return {candidate};
    names.push_back(candidate.path);
    if (candidate.effective() && Covers(name, candidate.path) && !named.contains(candidate.path))
      found.push_back(candidate);
  }
  for (const ParameterPath& path : found) {
    if (path.world != found[0].world || path.joint != found[0].joint ||
        path.link != found[0].link) {
      throw std::invalid_argument(where + "'" + name + "' is '" + found[0].path + "' and '" +
                                  path.path + "': one number cannot be both");
    }
  }
  if (!found.empty()) return found;
  std::string why;
  if (name.starts_with("contact/"))
    why = " (contact needs [simulation.contact] and collision shapes)";
  if (name.starts_with("limit/")) why = " (stops need [simulation.limit])";
  if (name.starts_with("length/"))
    why = " (a link whose joints and centre of mass coincide has no length)";
  throw std::invalid_argument(where + "the simulator has no parameter '" + name + "'" + why +
                              "; the nearest is '" + NearestName(name, names) + "'");
}

}  // namespace plumb
