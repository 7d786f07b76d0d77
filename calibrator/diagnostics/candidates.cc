#include "calibrator/diagnostics/candidates.h"

#include <algorithm>
#include <cmath>

#include "common/special_numbers.h"

namespace plumb {
namespace {

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
  const auto add = [&](const LinkParameterKind& kind, double value, double size) {
    const std::string entry = *kind.entry ? std::string("/") + kind.entry : "";
    const double lower = kind.values.lower < 0 ? -kInfinity : 0;
    all->push_back(
        {std::string(kind.name) + "/" + link.name + entry, kind.unit, value, 0.2 * size, lower});
  };
  for (const LinkParameterKind& kind : kLinkParameterKinds) {
    switch (kind.number) {
      case LinkParameterKind::Number::kMass:
        add(kind, link.mass, link.mass);
        break;
      case LinkParameterKind::Number::kInertia:
        add(kind, 1, 1);
        break;
      case LinkParameterKind::Number::kCenter:
        if (gyration > 0) add(kind, link.center_of_mass(kind.index), gyration);
        break;
      default:  // a shape, which the others tell enough of
        break;
    }
  }
}

void AddJoint(const JointDescription& joint, double effort, std::vector<Candidate>* all) {
  for (const JointParameterKind& kind : kJointParameterKinds) {
    const auto& surprise = kind.surprise;
    if (surprise.least == 0 || !joint.IsOf(kind.joints) || !joint.IsOf(surprise.joints)) continue;
    double value = joint.dynamics.*kind.member;
    // A parameter that must be positive begins above zero: the simulator has no spring of none.
    if (kind.values.lower > 0) value = std::max(value, 1e-9 * effort);
    const double least = surprise.least * (surprise.of_effort ? effort : 1);
    const bool turns = joint.type != JointDescription::Type::kPrismatic;
    all->push_back(
        {std::string(kind.name) + "/" + joint.name, turns ? kind.unit_turning : kind.unit_sliding,
         value, std::max(0.3 * std::abs(value), least), kind.values.lower < 0 ? -kInfinity : 0});
  }
}

}  // namespace

std::vector<Candidate> FindCandidates(const RobotDescription& robot) {
  const bool shapes =
      std::any_of(robot.links.begin() + 1, robot.links.end(),
                  [](const LinkDescription& link) { return !link.collisions.empty(); });
  std::vector<Candidate> all;
  World world = robot.simulation.world();
  for (const WorldParameterKind& kind : kWorldParameterKinds) {
    if (!robot.simulation.Has(kind.table)) continue;
    if (kind.table == WorldParameterKind::Table::kContact && !shapes) continue;
    const double value = kind.of(world);
    all.push_back({kind.name, kind.unit, value, kind.surprise * value, 0});
  }
  for (size_t i = 1; i < robot.links.size(); ++i) AddLink(robot.links[i], &all);
  for (const JointDescription& joint : robot.joints) AddJoint(joint, LargestEffort(robot), &all);
  for (const FrozenParameter& frozen : robot.frozen) {
    for (Candidate& candidate : all) {
      if (robot.ParameterOf(candidate.path) == frozen.name) candidate.value = frozen.value;
    }
  }
  std::erase_if(all, [&](const Candidate& candidate) {
    return robot.IsUncertain(candidate.path) || !(candidate.scale > 0);
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
