#include "calibrator/diagnostics/candidates.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace plumb {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Differences are taken over this share of a likely surprise: the errors of what is not smooth
// (contact, friction, delays) are asked for what such a change does to them, not for an
// infinitesimal one.
constexpr double kDifference = 0.2;
// A transition in which contact begins or ends with the change, say, is no witness: its derivative
// means nothing, but is large. Second differences may be such a share of first ones, and whitened
// errors may change so much without any notice.
constexpr double kLargestBend = 0.25, kNegligible = 0.1;

double LargestEffort(const RobotDescription& robot) {
  double largest = 0;
  for (const JointDescription& joint : robot.joints)
    largest = std::max(largest, joint.effort_limit);
  return largest > 0 ? largest : 1;
}

void AddLink(const LinkDescription& link, std::vector<Candidate>* all) {
  if (!(link.mass > 0)) return;
  const double gyration = std::sqrt(link.inertia.trace() / 2 / link.mass);
  all->push_back({"mass/" + link.name, "kg", link.mass, 0.2 * link.mass, 0});
  all->push_back({"inertia/" + link.name, "", 1, 0.2, 0});
  for (Eigen::Index k = 0; k < 3 && gyration > 0; ++k) {
    all->push_back({"com/" + link.name + "/" + "xyz"[k], "m", link.center_of_mass(k),
                    0.2 * gyration, -kInfinity});
  }
}

void AddJoint(const JointDescription& joint, double effort, std::vector<Candidate>* all) {
  const bool turns = joint.type != JointDescription::Type::kPrismatic;
  const std::string force = turns ? "Nm" : "N", place = turns ? "rad" : "m";
  const JointDynamics& has = joint.dynamics;
  const auto add = [&](const std::string& name, const std::string& unit, double value, double least,
                       double lower) {
    all->push_back(
        {name + "/" + joint.name, unit, value, std::max(0.3 * std::abs(value), least), lower});
  };
  add("damping", force + " s/" + place, has.damping, 0.01 * effort, 0);
  add("friction", force, has.friction, 0.05 * effort, 0);
  if (joint.type == JointDescription::Type::kSpherical) return;
  add("sensor_delay", "s", has.sensor_delay, 0.003, 0);
  add("sensor_bias", place, has.sensor_bias, 0.02, -kInfinity);
  if (joint.passive) return;
  add("armature", turns ? "kg m^2" : "kg", has.armature, 1e-3 * effort, 0);
  // The simulator has no spring of stiffness 0 among its uncertain parameters.
  add("stiffness", force + "/" + place, std::max(has.stiffness, 1e-9 * effort), 0.05 * effort, 0);
  add("gain", "", has.motor_gain, 0.1, 0);
  add("delay", "s", has.delay, 0.003, 0);
}

}  // namespace

std::vector<Candidate> FindCandidates(const RobotDescription& robot) {
  std::vector<Candidate> all = {
      {"gravity", "m/s^2", robot.simulation.gravity, 0.1 * robot.simulation.gravity, 0}};
  for (size_t i = 1; i < robot.links.size(); ++i) AddLink(robot.links[i], &all);
  for (const JointDescription& joint : robot.joints) AddJoint(joint, LargestEffort(robot), &all);
  const bool shapes =
      std::any_of(robot.links.begin() + 1, robot.links.end(),
                  [](const LinkDescription& link) { return !link.collisions.empty(); });
  if (const auto& contact = robot.simulation.contact; contact && shapes) {
    all.push_back({"contact/stiffness", "N/m", contact->stiffness, 0.5 * contact->stiffness, 0});
    all.push_back({"contact/damping", "N s/m", contact->damping, 0.5 * contact->damping, 0});
    all.push_back({"contact/friction", "", contact->friction, 0.5 * contact->friction, 0});
  }
  if (const auto& stop = robot.simulation.stop) {
    all.push_back({"limit/stiffness", "Nm/rad", stop->stiffness, 0.5 * stop->stiffness, 0});
    all.push_back({"limit/damping", "Nm s/rad", stop->damping, 0.5 * stop->damping, 0});
  }
  for (const FrozenParameter& frozen : robot.frozen) {
    for (Candidate& candidate : all) {
      if (candidate.path == frozen.name) candidate.value = frozen.value;
    }
  }
  std::erase_if(all, [&](const Candidate& candidate) {
    return robot.FindParameter(candidate.path) >= 0 || !(candidate.scale > 0);
  });
  return all;
}

RobotDescription WithCandidates(RobotDescription robot, const std::vector<Candidate>& candidates) {
  for (const Candidate& candidate : candidates) {
    std::erase_if(robot.frozen,
                  [&](const FrozenParameter& frozen) { return frozen.name == candidate.path; });
    robot.parameters.push_back({candidate.path, candidate.unit,
                                ParameterDescription::Coordinate::kLinear, candidate.value,
                                candidate.scale * candidate.scale});
  }
  return robot;
}

Eigen::MatrixXd CandidateColumns(const WhitenedErrors& whitened, const Eigen::VectorXd& physical,
                                 const std::vector<Candidate>& candidates) {
  const auto count = static_cast<Eigen::Index>(candidates.size());
  Eigen::VectorXd middle(physical.size() + count);
  middle.head(physical.size()) = physical;
  for (Eigen::Index k = 0; k < count; ++k)
    middle(physical.size() + k) = candidates[static_cast<size_t>(k)].value;
  const Eigen::VectorXd errors = whitened(middle);
  Eigen::MatrixXd columns = Eigen::MatrixXd::Zero(errors.size(), count);
  if (!errors.allFinite()) return columns;
  // One candidate at a time: the errors of all of them at once would be many times a log.
  for (Eigen::Index k = 0; k < count; ++k) {
    const Candidate& candidate = candidates[static_cast<size_t>(k)];
    const double h = kDifference * candidate.scale;
    const bool both = candidate.value - h >= candidate.lower;
    Eigen::MatrixXd ends = middle.replicate(1, 2);
    ends(physical.size() + k, 0) += h;
    ends(physical.size() + k, 1) += both ? -h : h / 2;
    const Eigen::MatrixXd at = whitened(ends);
    if (!at.allFinite()) continue;
    const Eigen::ArrayXd above = at.col(0), other = at.col(1), here = errors;
    const Eigen::ArrayXd change = both ? (above - other).eval() : (above - here).eval();
    const Eigen::ArrayXd bend =
        both ? (above - 2 * here + other).eval() : (above - 2 * other + here).eval();
    const auto smooth = bend.abs() <= kLargestBend * change.abs().max(kNegligible);
    columns.col(k) = smooth.select(change / (both ? 2 * h : h), 0);
  }
  return columns;
}

}  // namespace plumb
