#include "sim/parameters.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "common/config.h"

namespace plumb {
namespace {

// Stream words of the generators used here, so that no two purposes share numbers.
constexpr uint32_t kHiddenStream = 0x48494444;  // "HIDD"

}  // namespace

Parameters::Parameters(const RobotDescription& description) : means_(description.parameters.size()) {
  urdf_.gravity = kStandardGravity;
  for (const JointDescription& joint : description.joints) {
    const LinkDescription& link = description.links.at(static_cast<size_t>(joint.child));
    urdf_.bodies.push_back({link.mass, link.center_of_mass, link.inertia});
  }
  for (const ParameterDescription& parameter : description.parameters) {
    means_[static_cast<Eigen::Index>(names_.size())] = parameter.mean;
    names_.push_back(parameter.name);
    bindings_.push_back(Bind(description, parameter.name));
  }
}

Parameters::Binding Parameters::Bind(const RobotDescription& description, const std::string& path) const {
  if (path == "gravity") return {Kind::kGravity, 0, kStandardGravity};
  std::string nearest = "gravity";
  for (size_t body = 0; body < description.joints.size(); ++body) {
    const int link = description.joints[body].child;
    const std::string& name = description.links[static_cast<size_t>(link)].name;
    if (path == "mass/" + name) return {Kind::kMass, body, urdf_.bodies[body].mass};
    if (path == "length/" + name) {
      const double length = 2 * urdf_.bodies[body].center_of_mass.norm();
      if (!(length > 0)) {
        throw std::invalid_argument("parameter '" + path +
                                    "': the link's centre of mass is at its joint, so it has no length");
      }
      if (std::any_of(description.joints.begin(), description.joints.end(),
                      [link](const JointDescription& joint) { return joint.parent == link; })) {
        throw std::invalid_argument("parameter '" + path +
                                    "': only a link that carries no further joint can be stretched");
      }
      return {Kind::kLength, body, length};
    }
    for (const std::string& candidate : {"mass/" + name, "length/" + name}) {
      if (EditDistance(path, candidate) < EditDistance(path, nearest)) nearest = candidate;
    }
  }
  throw std::invalid_argument("the simulator has no parameter '" + path + "'; the nearest is '" + nearest +
                              "'");
}

InertialModel Parameters::Nominal() const {
  InertialModel model = urdf_;
  Apply(means_, model);
  return model;
}

void Parameters::Apply(const Eigen::Ref<const Eigen::VectorXd>& physical, InertialModel& model) const {
  if (physical.size() != size()) {
    throw std::invalid_argument("the simulator has " + std::to_string(size()) + " parameters, not " +
                                std::to_string(physical.size()));
  }
  for (int i = 0; i < size(); ++i) {
    const bool zero_allowed = bindings_[static_cast<size_t>(i)].kind == Kind::kGravity;
    if (!std::isfinite(physical[i]) || physical[i] < 0 || (physical[i] == 0 && !zero_allowed)) {
      throw std::invalid_argument("parameter '" + names_[static_cast<size_t>(i)] + "' cannot be " +
                                  std::to_string(physical[i]));
    }
  }
  model = urdf_;  // equal sizes: copies values, does not allocate
  for (int i = 0; i < size(); ++i) {
    const Binding& binding = bindings_[static_cast<size_t>(i)];
    if (binding.kind == Kind::kGravity) {
      model.gravity = physical[i];
      continue;
    }
    InertialModel::Body& body = model.bodies[binding.body];
    const double factor = physical[i] / binding.reference;
    if (binding.kind == Kind::kMass) {
      body.mass *= factor;
      body.inertia *= factor;
    } else {
      body.center_of_mass *= factor;
      body.inertia *= factor * factor;
    }
  }
}

Eigen::VectorXd HiddenParameters(const RobotDescription& description, uint64_t seed) {
  Eigen::VectorXd physical(description.parameters.size());
  for (size_t i = 0; i < description.parameters.size(); ++i) {
    physical[static_cast<Eigen::Index>(i)] = description.parameters[i].mean;
  }
  for (const HiddenParameter& hidden : description.virtual_robot.hidden) {
    const int index = description.FindParameter(hidden.name);
    if (index < 0) throw std::invalid_argument("hidden '" + hidden.name + "' is not one of the parameters");
    // One stream per parameter: hiding one more does not change the others.
    physical[index] =
        Random(seed, {kHiddenStream, static_cast<uint32_t>(index)}).Uniform(hidden.lower, hidden.upper);
  }
  return physical;
}

}  // namespace plumb
