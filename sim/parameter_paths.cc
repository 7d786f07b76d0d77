// The paths that a robot's parameters can have.
#include <algorithm>
#include <stdexcept>

#include "common/nearest_name.h"
#include "sim/parameter_names.h"
#include "sim/parameters.h"

namespace plumb {

using Eigen::Vector3d;

Parameters::Paths Parameters::AllPaths(const RobotDescription& description) const {
  Paths paths;
  const auto domain = [](const std::string& name) {
    if (name == "rest" || name == "sensor_bias") return Domain::kAny;
    if (name == "delay" || name == "sensor_delay") return Domain::kDelay;
    if (name == "no_load_speed" || name.ends_with("stiffness")) return Domain::kMoreThanZero;
    return Domain::kZeroOrMore;
  };
  for (size_t slot = 0; slot < std::size(kGlobalNames); ++slot) {
    const std::string name = kGlobalNames[slot];
    if (name.starts_with("contact/") && !description.simulation.contact) continue;
    if (name.starts_with("limit/") && !description.simulation.stop) continue;
    paths.push_back({name, {.effect = Effect::kGlobal, .domain = domain(name), .slot = slot}});
  }
  paths.push_back({"mass/" + description.links[0].name,
                   {.effect = Effect::kNone, .domain = Domain::kMoreThanZero}});
  size_t velocity = 0;
  for (size_t i = 0; i < description.joints.size(); ++i) {
    const std::string& link = description.links[i + 1].name;
    const auto add = [&](const std::string& path, Effect effect, Domain in, size_t slot = 0,
                         double reference = 1) {
      paths.push_back(
          {path,
           {.effect = effect, .domain = in, .index = i, .slot = slot, .reference = reference}});
    };
    if (base_.links[i].mass > 0) {
      add("mass/" + link, Effect::kMass, Domain::kMoreThanZero, 0, base_.links[i].mass);
      add("inertia/" + link, Effect::kInertia, Domain::kMoreThanZero);
      for (size_t k = 0; k < 3; ++k)
        add("com/" + link + "/" + "xyz"[k], Effect::kCenter, Domain::kAny, k);
      for (size_t k = 0; k < 6; ++k) {
        add("inertia/" + link + "/" + kEntries[k].name, Effect::kCholesky, Domain::kExponent, k);
      }
    }
    const auto child = std::find_if(parents_.begin(), parents_.end(),
                                    [&](int p) { return p == static_cast<int>(i) + 1; });
    const double length =
        child == parents_.end()
            ? 2 * centers_[i].norm()
            : Vector3d::Map(base_.links[static_cast<size_t>(child - parents_.begin())].origin)
                  .norm();
    if (length > 0) add("length/" + link, Effect::kLength, Domain::kMoreThanZero, 0, length);
    const JointDescription& joint = description.joints[i];
    for (size_t slot = 0; slot < std::size(kAxisNames); ++slot) {
      const std::string name = kAxisNames[slot];
      // Springs, sensors and speed limits of a spherical joint are not modelled; motors' numbers
      // need a motor.
      if (joint.type == JointDescription::Type::kSpherical && slot > 2) continue;
      if (joint.passive && (name == "gain" || name == "delay" || name == "no_load_speed")) continue;
      paths.push_back({name + "/" + joint.name,
                       {.effect = slot == kSlowing ? Effect::kSpeedLimit : Effect::kAxis,
                        .domain = domain(name),
                        .index = velocity,
                        .slot = slot,
                        .count = static_cast<size_t>(joint.num_velocities())}});
    }
    velocity += static_cast<size_t>(joint.num_velocities());
  }
  return paths;
}

Parameters::Binding Parameters::Find(const Paths& paths, const std::string& path) {
  std::vector<std::string> names;
  for (const auto& [name, binding] : paths) {
    if (name == path) return binding;
    names.push_back(name);
  }
  std::string why;
  if (path.starts_with("contact/"))
    why = " (contact needs [simulation.contact] and collision shapes)";
  if (path.starts_with("limit/")) why = " (stops need [simulation.limit])";
  if (path.starts_with("length/"))
    why = " (a link whose joints and centre of mass coincide has no length)";
  throw std::invalid_argument("the simulator has no parameter '" + path + "'" + why +
                              "; the nearest is '" + NearestName(path, names) + "'");
}

}  // namespace plumb
