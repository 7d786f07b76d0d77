#include "sim/parameters.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include "robot/contact_pairs.h"
#include "robot/contact_points.h"

namespace plumb {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Stream words of the generators used here, so that no two purposes share numbers.
constexpr uint32_t kHiddenStream = 0x48494444;  // "HIDD"

using Number = LinkParameterKind::Number;

// xx, yy, zz, xy, xz, yz of a matrix.
constexpr struct { int row, column; } kEntries[] = {{0, 0}, {1, 1}, {2, 2}, {1, 0}, {2, 0}, {2, 1}};

constexpr Range kDelays{0, JointDynamics::kLongestDelay};

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

bool IsCholesky(const ParameterPath& path) {
  return path.link && path.link->number == Number::kCholesky;
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
    // A longer delay would need too much memory.
    Check("delay/" + joint.name, kDelays, joint.dynamics.delay);
    Check("sensor_delay/" + joint.name, kDelays, joint.dynamics.sensor_delay);
    base_.axes.insert(base_.axes.end(), static_cast<size_t>(joint.num_velocities()),
                      joint.dynamics);
  }
  base_.world = description.simulation.world();
  if (description.simulation.contact) {
    for (const ContactPoint& at : ContactPoints(description)) {
      Physics<double>::Point point{};
      Vector3d::Map(point.position) = topology.link_axes[static_cast<size_t>(at.link)] * at.centre;
      point.radius = at.radius;
      base_.points.push_back(point);
      point_links_.push_back(at.link);
    }
  }
  for (const ContactPairs::Solid& at : FindContactPairs(description).solids) {
    const auto link = static_cast<size_t>(at.link);
    const Shape& shape = description.links[link].collisions[at.shape];
    const RoundedBox box(shape);
    Physics<double>::Solid solid{};
    Vector3d::Map(solid.position) = topology.link_axes[link] * shape.position;
    Vector3d::Map(solid.half) = box.half;
    solid.radius = box.radius;
    base_.solids.push_back(solid);
    solid_links_.push_back(at.link);
  }

  FindPathsOf(description);
  FindTerms(description);
}

void Parameters::FindPathsOf(const RobotDescription& description) {
  const std::vector<ParameterPath> all = ParameterPaths(description, base_);
  std::set<std::string> named;
  for (const ParameterDescription& parameter : description.parameters) named.insert(parameter.name);
  for (const FrozenParameter& parameter : description.frozen) named.insert(parameter.name);
  std::map<std::string, std::string> given;  // by which parameter
  const auto find = [&](const std::string& name) {
    std::vector<ParameterPath> paths = FindPaths(all, name, named, description);
    for (const ParameterPath& path : paths) {
      const auto [other, is_new] = given.try_emplace(path.path, name);
      if (is_new) continue;
      throw std::invalid_argument(description.file + ": [[parameter]]: '" + other->second +
                                  "' and '" + name + "' both give '" + path.path + "'");
    }
    return paths;
  };
  for (size_t i = 0; i < description.parameters.size(); ++i) {
    const auto parameter = static_cast<int>(i);
    means_[parameter] = description.parameters[i].mean;
    for (const ParameterPath& path : find(description.parameters[i].name)) {
      uncertain_.push_back({path, parameter});
      if (IsCholesky(path)) AddCholesky(path, parameter, 0);
    }
  }
  for (const FrozenParameter& parameter : description.frozen) {
    for (const ParameterPath& path : find(parameter.name)) {
      Check(path.path, path.values, parameter.value);
      Freeze(path, parameter.value);
    }
  }
}

void Parameters::Check(const std::string& path, Range values, double value) {
  if (!(values.lower <= value && value <= values.upper))
    throw std::invalid_argument("parameter '" + path + "' cannot be " + std::to_string(value));
}

void Parameters::Freeze(const ParameterPath& path, double value) {
  if (IsCholesky(path)) {
    AddCholesky(path, -1, value);
  } else if (path.link && path.link->number != Number::kCenter) {
    factors_.push_back({path, value});
  } else {
    Set(path, value, &base_);
  }
}

void Parameters::AddCholesky(const ParameterPath& path, int parameter, double value) {
  auto found = std::find_if(inertias_.begin(), inertias_.end(),
                            [&](const Inertia& i) { return i.link == path.index; });
  if (found == inertias_.end()) {
    inertias_.push_back({path.index, {-1, -1, -1, -1, -1, -1}, {}});
    found = std::prev(inertias_.end());
  }
  const auto entry = static_cast<size_t>(path.link->index);
  found->parameter[entry] = parameter;
  found->value[entry] = value;
}

void Parameters::FindTerms(const RobotDescription& description) {
  constexpr JointDynamics kDefault;
  for (size_t i = 0; i < std::size(kJointParameterKinds); ++i) {
    const JointParameterKind& kind = kJointParameterKinds[i];
    const auto has = [&](const JointDynamics& axis) {
      return axis.*kind.member != kDefault.*kind.member;
    };
    const auto may_have = [&](const Uncertain& one) { return one.path.joint == &kind; };
    terms_.joints[i] = std::any_of(base_.axes.begin(), base_.axes.end(), has) ||
                       std::any_of(uncertain_.begin(), uncertain_.end(), may_have);
  }
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
  for (const auto& [path, i] : uncertain_) Check(path.path, path.values, physical[i]);
  *physics = base_;  // equal sizes: copies values, does not allocate
  for (const auto& [path, i] : uncertain_) Set(path, physical[i], physics);
  for (const Inertia& inertia : inertias_) SetInertia(inertia, physical, physics);
  for (const Fixed& fixed : factors_) Scale(fixed.path, fixed.value, physics);
  for (const auto& [path, i] : uncertain_) Scale(path, physical[i], physics);
}

void Parameters::Set(const ParameterPath& path, double value, Physics<double>* physics) const {
  if (path.world) path.world->of(physics->world) = value;
  if (path.joint) {
    for (size_t k = 0; k < path.count; ++k)
      physics->axes[path.index + k].*path.joint->member = value;
  }
  if (path.link && path.link->number == Number::kCenter) {
    const Eigen::Index entry = path.link->index;
    Vector3d::Map(physics->links[path.index].center) +=
        (value - centers_[path.index][entry]) * link_axes_[path.index].col(entry);
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

void Parameters::Scale(const ParameterPath& path, double value, Physics<double>* physics) const {
  if (!path.link) return;
  const double factor = value / path.reference;
  Physics<double>::Link& scaled = physics->links[path.index];
  const auto scale = [](double* numbers, size_t count, double by) {
    for (size_t k = 0; k < count; ++k) numbers[k] *= by;
  };
  switch (path.link->number) {
    case Number::kMass:
      scaled.mass *= factor;
      scale(scaled.inertia, 6, factor);
      break;
    case Number::kInertia:
      scale(scaled.inertia, 6, factor);
      break;
    case Number::kLength: {
      const int link = static_cast<int>(path.index) + 1;
      scale(scaled.center, 3, factor);
      scale(scaled.inertia, 6, factor * factor);
      for (size_t i = 0; i < parents_.size(); ++i) {
        if (parents_[i] == link) scale(physics->links[i].origin, 3, factor);
      }
      for (size_t i = 0; i < point_links_.size(); ++i) {
        if (point_links_[i] == link) scale(physics->points[i].position, 3, factor);
      }
      for (size_t i = 0; i < solid_links_.size(); ++i) {
        if (solid_links_[i] != link) continue;
        scale(physics->solids[i].position, 3, factor);
        scale(physics->solids[i].half, 3, factor);
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
