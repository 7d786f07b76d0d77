#include "calibrator/diagnostics/identifiability_summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace plumb {
namespace {

constexpr Eigen::Index kMaxNames = 6;  // of determined parameters: more are only counted

// "length/pole" -> "length", unless another parameter would read the same.
std::string ShortName(const RobotDescription& robot, size_t index) {
  const auto stem = [](const std::string& name) { return name.substr(0, name.find('/')); };
  const std::string& name = robot.parameters[index].name;
  const auto same = std::count_if(robot.parameters.begin(), robot.parameters.end(),
                                  [&](const auto& p) { return stem(p.name) == stem(name); });
  return same == 1 ? stem(name) : "(" + name + ")";
}

bool IsLog(const RobotDescription& robot, size_t index) {
  return robot.parameters[index].coordinate == ParameterDescription::Coordinate::kLog;
}

// Index of the only parameter that has an entry, -1 if there are more.
Eigen::Index Single(const Eigen::VectorXd& x) {
  if ((x.array() != 0).count() != 1) return -1;
  Eigen::Index index;
  x.cwiseAbs().maxCoeff(&index);
  return index;
}

const std::string& FullName(const RobotDescription& robot, Eigen::Index index) {
  return robot.parameters[static_cast<size_t>(index)].name;
}

// "gravity / length and mass length^2", of many parameters on their own only how many.
std::string Known(const std::vector<Combination>& combinations) {
  std::vector<std::string> names;
  const auto alone = std::count_if(combinations.begin(), combinations.end(),
                                   [](const auto& c) { return Single(c.power) >= 0; });
  if (alone > kMaxNames) names.push_back(fmt::format("{} parameters on their own", alone));
  for (const Combination& combination : combinations) {
    if (alone <= kMaxNames || Single(combination.power) < 0) names.push_back(combination.name);
  }
  return names.empty() ? "nothing" : "only " + fmt::format("{}", fmt::join(names, " and "));
}

// Directions of several parameters that change nothing.
std::string Coupled(const RobotDescription& robot, const Eigen::VectorXd& mean,
                    const Identifiability& found) {
  std::vector<std::string> names;
  for (size_t i = 0; i < robot.parameters.size(); ++i) {
    const bool involved =
        std::any_of(found.null.begin(), found.null.end(), [&](const Eigen::VectorXd& direction) {
          return Single(direction) < 0 && direction(static_cast<Eigen::Index>(i)) != 0;
        });
    if (involved) names.push_back(ShortName(robot, i));
  }
  if (names.empty()) return "";
  std::string summary =
      "; " + fmt::format("{}", fmt::join(names, ", ")) + " are not identifiable separately:";
  for (const Eigen::VectorXd& direction : found.null) {
    if (Single(direction) < 0)
      summary += " (" + DirectionName(robot, mean, direction) + ") changes nothing";
  }
  return summary;
}

// "mass/world has no effect on this motion", for those of which that is so.
std::string WithoutEffect(const RobotDescription& robot, const Identifiability& found) {
  std::vector<std::string> names;
  for (const Eigen::VectorXd& direction : found.null) {
    if (Single(direction) >= 0) names.push_back(FullName(robot, Single(direction)));
  }
  if (names.empty()) return "";
  return "; " + fmt::format("{}", fmt::join(names, ", ")) + (names.size() == 1 ? " has" : " have") +
         " no effect on this motion";
}

std::string Weak(const RobotDescription& robot, const Eigen::VectorXd& mean,
                 const Identifiability& found) {
  std::string summary;
  for (const WeakDirection& weak : found.weak) {
    const Eigen::Index single = Single(weak.direction);
    summary += single >= 0
                   ? "; " + FullName(robot, single) + " is hardly determined"
                   : "; (" + DirectionName(robot, mean, weak.direction) + ") changes little";
    summary += fmt::format(": posterior sd is {:.0f} % of the prior's", 100 * weak.sd_ratio);
  }
  return summary;
}

}  // namespace

bool AllLog(const RobotDescription& robot, const Eigen::VectorXd& power) {
  for (Eigen::Index i = 0; i < power.size(); ++i) {
    if (power(i) != 0 && !IsLog(robot, static_cast<size_t>(i))) return false;
  }
  return true;
}

std::string CombinationName(const RobotDescription& robot, const Eigen::VectorXd& power) {
  std::string above, below;
  for (Eigen::Index i = 0; i < power.size(); ++i) {
    if (power(i) == 0) continue;
    const std::string name = ShortName(robot, static_cast<size_t>(i));
    if (!AllLog(robot, power)) {
      above += fmt::format("{}{:.3g} {}", above.empty() ? "" : " + ", power(i), name);
      continue;
    }
    std::string& side = power(i) > 0 ? above : below;
    side += (side.empty() ? "" : " ") + name;
    if (std::abs(power(i)) != 1) side += fmt::format("^{:.3g}", std::abs(power(i)));
  }
  if (below.empty()) return above;
  return (above.empty() ? "1" : above) + " / " + below;
}

std::string DirectionName(const RobotDescription& robot, const Eigen::VectorXd& mean,
                          const Eigen::VectorXd& direction) {
  bool any_log = false;
  for (Eigen::Index i = 0; i < direction.size(); ++i) {
    any_log = any_log || (direction(i) != 0 && IsLog(robot, static_cast<size_t>(i)));
  }
  const double step = any_log ? 0.01 : 1;  // a hundredth in a logarithm is one per cent
  std::vector<std::string> moves;
  for (Eigen::Index i = 0; i < direction.size(); ++i) {
    if (direction(i) == 0) continue;
    const auto index = static_cast<size_t>(i);
    const ParameterDescription& parameter = robot.parameters[index];
    if (IsLog(robot, index)) {
      moves.push_back(fmt::format("{} {:+.3g} %", ShortName(robot, index), direction(i)));
      continue;
    }
    const double small = 1e-4 * std::sqrt(parameter.coordinate_variance());
    const double slope =
        (parameter.ToPhysical(mean(i) + small) - parameter.ToPhysical(mean(i) - small)) /
        (2 * small);
    moves.push_back(fmt::format("{} {:+.3g}{}{}", ShortName(robot, index),
                                step * slope * direction(i), parameter.unit.empty() ? "" : " ",
                                parameter.unit));
  }
  return fmt::format("{}", fmt::join(moves, ", "));
}

std::string IdentifiabilitySummary(const RobotDescription& robot, const Eigen::VectorXd& mean,
                                   const Identifiability& found) {
  std::string summary = "every parameter is determined by this motion";
  const bool coupled = std::any_of(found.null.begin(), found.null.end(),
                                   [](const auto& d) { return Single(d) < 0; });
  if (coupled) {
    summary = Known(found.combinations) + " can be known from this motion";
  } else if (!found.null.empty()) {
    summary = found.combinations.empty() ? "nothing can be known from this motion"
                                         : "every other parameter is determined by this motion";
  } else if (std::any_of(found.weak.begin(), found.weak.end(),
                         [](const WeakDirection& weak) { return Single(weak.direction) >= 0; })) {
    summary = "every other parameter is determined by this motion";
  }
  return summary + Coupled(robot, mean, found) + WithoutEffect(robot, found) +
         Weak(robot, mean, found);
}

}  // namespace plumb
