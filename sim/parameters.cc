#include "sim/parameters.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "robot/contact_points.h"
#include "sim/parameter_names.h"

namespace plumb {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Stream words of the generators used here, so that no two purposes share numbers.
constexpr uint32_t kHiddenStream = 0x48494444;  // "HIDD"

// Beyond e^20 an inertia's shape is no parameter any more, and far from overflow.
constexpr double kLargestExponent = 20;

void Write(const Matrix3d& inertia, double* entries) {
  for (size_t i = 0; i < 6; ++i) entries[i] = inertia(kEntries[i].row, kEntries[i].column);
}

// Lower triangular L with L L^T = s, of a matrix that may have zero eigenvalues.
Matrix3d Root(const Matrix3d& s) {
  Matrix3d l = Matrix3d::Zero();
  const double nothing = 1e-14 * s.trace();
  for (int j = 0; j < 3; ++j) {
    const double pivot = s(j, j) - l.row(j).head(j).squaredNorm();
    if (!(pivot > nothing)) continue;
    l(j, j) = std::sqrt(pivot);
    for (int i = j + 1; i < 3; ++i)
      l(i, j) = (s(i, j) - l.row(i).head(j).dot(l.row(j).head(j))) / l(j, j);
  }
  return l;
}

// The inertia of second moments of mass s, and back.
Matrix3d FromMoments(const Matrix3d& s) { return s.trace() * Matrix3d::Identity() - s; }
Matrix3d ToMoments(const Matrix3d& inertia) {
  return inertia.trace() / 2 * Matrix3d::Identity() - inertia;
}

}  // namespace

Parameters::Parameters(const RobotDescription& description, const Topology& topology)
    : means_(description.parameters.size()) {
  for (size_t i = 0; i < description.joints.size(); ++i) {
    const JointDescription& joint = description.joints[i];
    const LinkDescription& link = description.links.at(i + 1);
    const Matrix3d& axes = topology.link_axes[i + 1];
    parents_.push_back(joint.parent);
    link_axes_.push_back(axes);
    centers_.push_back(link.center_of_mass);
    roots_.push_back(axes * Root(ToMoments(link.inertia)));
    Physics<double>::Link physics{};
    physics.mass = link.mass;
    Vector3d::Map(physics.center) = axes * link.center_of_mass;
    Write(axes * link.inertia * axes.transpose(), physics.inertia);
    Vector3d::Map(physics.origin) =
        topology.link_axes[static_cast<size_t>(joint.parent)] * joint.origin;
    base_.links.push_back(physics);
    const JointDynamics& d = joint.dynamics;
    Check("delay/" + joint.name, Domain::kDelay, d.delay);
    Check("sensor_delay/" + joint.name, Domain::kDelay, d.sensor_delay);
    const Physics<double>::Axis axis{d.armature,     d.damping,    d.friction,          d.stiffness,
                                     d.rest,         d.motor_gain, 1 / d.no_load_speed, d.delay,
                                     d.sensor_delay, d.sensor_bias};
    base_.axes.insert(base_.axes.end(), static_cast<size_t>(joint.num_velocities()), axis);
  }
  const SimulationSettings& settings = description.simulation;
  base_.globals = {settings.gravity, 0, 0, 0, 0, 0};
  if (settings.contact) {
    base_.globals.contact_stiffness = settings.contact->stiffness;
    base_.globals.contact_damping = settings.contact->damping;
    base_.globals.contact_friction = settings.contact->friction;
    for (const ContactPoint& at : ContactPoints(description)) {
      Physics<double>::Point point{};
      Vector3d::Map(point.position) = topology.link_axes[static_cast<size_t>(at.link)] * at.centre;
      point.radius = at.radius;
      base_.points.push_back(point);
      point_links_.push_back(at.link);
    }
  }
  if (settings.stop) {
    base_.globals.stop_stiffness = settings.stop->stiffness;
    base_.globals.stop_damping = settings.stop->damping;
  }

  const Paths paths = AllPaths(description);
  for (const ParameterDescription& parameter : description.parameters) {
    const auto index = static_cast<int>(bindings_.size());
    bindings_.push_back(Find(paths, parameter.name));
    names_.push_back(parameter.name);
    means_[index] = parameter.mean;
    if (bindings_.back().effect == Effect::kCholesky) AddCholesky(bindings_.back(), index, 0);
  }
  for (const FrozenParameter& parameter : description.frozen) {
    const Binding binding = Find(paths, parameter.name);
    Check(parameter.name, binding.domain, parameter.value);
    Freeze(binding, parameter.value);
  }
  FindTerms(description);
}

void Parameters::Check(const std::string& name, Domain domain, double value) {
  bool fits = std::isfinite(value);
  switch (domain) {
    case Domain::kAny:
      break;
    case Domain::kZeroOrMore:
      fits = fits && value >= 0;
      break;
    case Domain::kMoreThanZero:
      fits = fits && value > 0;
      break;
    case Domain::kDelay:
      fits = fits && value >= 0 && value <= JointDynamics::kLongestDelay;
      break;
    case Domain::kExponent:
      fits = fits && std::abs(value) <= kLargestExponent;
      break;
  }
  if (!fits)
    throw std::invalid_argument("parameter '" + name + "' cannot be " + std::to_string(value));
}

void Parameters::Freeze(const Binding& binding, double value) {
  switch (binding.effect) {
    case Effect::kNone:
      break;
    case Effect::kCholesky:
      AddCholesky(binding, -1, value);
      break;
    case Effect::kMass:
    case Effect::kInertia:
    case Effect::kLength:
      factors_.push_back({binding, value});
      break;
    default:
      Set(binding, value, &base_);
  }
}

void Parameters::AddCholesky(const Binding& binding, int parameter, double value) {
  auto found = std::find_if(inertias_.begin(), inertias_.end(),
                            [&](const Inertia& i) { return i.link == binding.index; });
  if (found == inertias_.end()) {
    inertias_.push_back({binding.index, {-1, -1, -1, -1, -1, -1}, {}});
    found = std::prev(inertias_.end());
  }
  found->parameter[binding.slot] = parameter;
  found->value[binding.slot] = value;
}

void Parameters::FindTerms(const RobotDescription& description) {
  const auto has = [&](size_t slot) {
    for (const auto& axis : base_.axes) {
      if (reinterpret_cast<const double*>(&axis)[slot] != 0) return true;
    }
    return std::any_of(bindings_.begin(), bindings_.end(), [&](const Binding& b) {
      return (b.effect == Effect::kAxis || b.effect == Effect::kSpeedLimit) && b.slot == slot;
    });
  };
  terms_.friction = has(2);
  terms_.springs = has(3);
  terms_.slowing = has(kSlowing);
  delays_ = has(7);
  terms_.sensors = has(8) || has(9);
  terms_.stops = description.simulation.stop.has_value();
}

Physics<double> Parameters::Nominal() const {
  Physics<double> physics = base_;
  Apply(means_, &physics);
  return physics;
}

void Parameters::Apply(const Eigen::Ref<const Eigen::VectorXd>& physical,
                       Physics<double>* physics) const {
  if (physical.size() != size()) {
    throw std::invalid_argument("the simulator has " + std::to_string(size()) +
                                " parameters, not " + std::to_string(physical.size()));
  }
  for (int i = 0; i < size(); ++i) {
    Check(names_[static_cast<size_t>(i)], bindings_[static_cast<size_t>(i)].domain, physical[i]);
  }
  *physics = base_;  // equal sizes: copies values, does not allocate
  for (int i = 0; i < size(); ++i) Set(bindings_[static_cast<size_t>(i)], physical[i], physics);
  for (const Inertia& inertia : inertias_) SetInertia(inertia, physical, physics);
  for (const Fixed& fixed : factors_) Scale(fixed.binding, fixed.value, physics);
  for (int i = 0; i < size(); ++i) Scale(bindings_[static_cast<size_t>(i)], physical[i], physics);
}

void Parameters::Set(const Binding& binding, double value, Physics<double>* physics) const {
  switch (binding.effect) {
    case Effect::kGlobal:
      reinterpret_cast<double*>(&physics->globals)[binding.slot] = value;
      break;
    case Effect::kAxis:
    case Effect::kSpeedLimit:
      for (size_t k = 0; k < binding.count; ++k) {
        auto* axis = reinterpret_cast<double*>(&physics->axes[binding.index + k]);
        axis[binding.slot] = binding.effect == Effect::kSpeedLimit ? 1 / value : value;
      }
      break;
    case Effect::kCenter: {
      const auto slot = static_cast<Eigen::Index>(binding.slot);
      Vector3d::Map(physics->links[binding.index].center) +=
          (value - centers_[binding.index][slot]) * link_axes_[binding.index].col(slot);
      break;
    }
    default:
      break;
  }
}

void Parameters::SetInertia(const Inertia& inertia,
                            const Eigen::Ref<const Eigen::VectorXd>& physical,
                            Physics<double>* physics) const {
  Matrix3d c = Matrix3d::Zero();
  for (size_t k = 0; k < 6; ++k) {
    const double value =
        inertia.parameter[k] >= 0 ? physical[inertia.parameter[k]] : inertia.value[k];
    c(kEntries[k].row, kEntries[k].column) = k < 3 ? std::exp(value) : value;
  }
  const Matrix3d root = roots_[inertia.link] * c;
  Write(FromMoments(root * root.transpose()), physics->links[inertia.link].inertia);
}

void Parameters::Scale(const Binding& binding, double value, Physics<double>* physics) const {
  const double factor = value / binding.reference;
  const auto scale = [](double* numbers, size_t count, double by) {
    for (size_t k = 0; k < count; ++k) numbers[k] *= by;
  };
  switch (binding.effect) {
    case Effect::kMass:
      physics->links[binding.index].mass *= factor;
      scale(physics->links[binding.index].inertia, 6, factor);
      break;
    case Effect::kInertia:
      scale(physics->links[binding.index].inertia, 6, factor);
      break;
    case Effect::kLength: {
      const int link = static_cast<int>(binding.index) + 1;
      scale(physics->links[binding.index].center, 3, factor);
      scale(physics->links[binding.index].inertia, 6, factor * factor);
      for (size_t i = 0; i < parents_.size(); ++i) {
        if (parents_[i] == link) scale(physics->links[i].origin, 3, factor);
      }
      for (size_t i = 0; i < point_links_.size(); ++i) {
        if (point_links_[i] == link) scale(physics->points[i].position, 3, factor);
      }
      break;
    }
    default:
      break;
  }
}

Eigen::VectorXd HiddenParameters(const RobotDescription& description, uint64_t seed) {
  Eigen::VectorXd physical(description.parameters.size());
  for (size_t i = 0; i < description.parameters.size(); ++i) {
    physical[static_cast<Eigen::Index>(i)] = description.parameters[i].mean;
  }
  for (const HiddenParameter& hidden : description.virtual_robot.hidden) {
    const int index = description.FindParameter(hidden.name);
    if (index < 0)
      throw std::invalid_argument("hidden '" + hidden.name + "' is not one of the parameters");
    // One stream per parameter: hiding one more does not change the others.
    physical[index] = Random(seed, {kHiddenStream, static_cast<uint32_t>(index)})
                          .Uniform(hidden.lower, hidden.upper);
  }
  return physical;
}

}  // namespace plumb
