#include "calibrator/identifiability.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

namespace plumb {
namespace {

constexpr double kNull = 1e-6;
constexpr int kLargestPower = 2;

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

bool AllLog(const RobotDescription& robot, const Eigen::VectorXd& power) {
  for (Eigen::Index i = 0; i < power.size(); ++i) {
    if (power(i) != 0 && !IsLog(robot, static_cast<size_t>(i))) return false;
  }
  return true;
}

std::string Name(const RobotDescription& robot, const Eigen::VectorXd& power) {
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

// Every vector of small integer powers with its first entry positive, fewest and smallest powers first.
std::vector<Eigen::VectorXd> SmallPowers(Eigen::Index n) {
  std::vector<Eigen::VectorXd> powers;
  const auto base = static_cast<size_t>(2 * kLargestPower + 1);
  size_t count = 1;
  for (Eigen::Index i = 0; i < n; ++i) count *= base;
  for (size_t code = 0; code < count; ++code) {
    Eigen::VectorXd power(n);
    size_t rest = code;
    for (Eigen::Index i = 0; i < n; ++i, rest /= base) {
      power(i) = static_cast<double>(rest % base) - kLargestPower;
    }
    Eigen::Index first = 0;
    while (first < n && power(first) == 0) ++first;
    if (first < n && power(first) > 0) powers.push_back(power);
  }
  return powers;
}

// Linearly independent combinations that span the complement of the null directions, in the simplest form:
// integer powers where there are some, the eigenvectors themselves otherwise.
std::vector<Eigen::VectorXd> SimplePowers(const Eigen::MatrixXd& null, const Eigen::MatrixXd& determined,
                                          const Eigen::MatrixXd& covariance) {
  const Eigen::Index n = determined.rows(), rank = determined.cols();
  std::vector<Eigen::VectorXd> chosen;
  if (rank == n) {
    for (Eigen::Index i = 0; i < n; ++i) chosen.push_back(Eigen::VectorXd::Unit(n, i));
    return chosen;
  }
  std::vector<Eigen::VectorXd> candidates;
  if (n <= 6) {
    for (Eigen::VectorXd& power : SmallPowers(n)) {
      if ((null.transpose() * power).norm() < 1e-3 * power.norm()) candidates.push_back(std::move(power));
    }
  }
  std::stable_sort(candidates.begin(), candidates.end(), [&](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
    const auto key = [&](const Eigen::VectorXd& p) {
      return std::make_tuple((p.array() != 0).count(), p.cwiseAbs().sum(), p.dot(covariance * p));
    };
    return key(a) < key(b);
  });
  Eigen::MatrixXd basis(n, 0);
  for (const Eigen::VectorXd& candidate : candidates) {
    Eigen::MatrixXd extended(n, basis.cols() + 1);
    extended << basis, candidate;
    if (extended.fullPivHouseholderQr().rank() == extended.cols()) {
      basis = extended;
      chosen.push_back(candidate);
    }
    if (basis.cols() == rank) return chosen;
  }
  chosen.clear();
  for (Eigen::Index i = 0; i < rank; ++i) chosen.push_back(determined.col(i));
  return chosen;
}

std::string Words(const RobotDescription& robot, const Identifiability& found) {
  if (found.null.empty()) return "every parameter is determined by this motion";
  std::string words = found.combinations.empty() ? "nothing" : "only ";
  std::string names;
  for (size_t i = 0; i < found.combinations.size(); ++i) {
    words += (i == 0 ? "" : " and ") + found.combinations[i].name;
  }
  words += " can be known from this motion; ";
  for (size_t i = 0; i < robot.parameters.size(); ++i) {
    const bool involved = std::any_of(found.null.begin(), found.null.end(), [&](const Eigen::VectorXd& direction) {
      return std::abs(direction(static_cast<Eigen::Index>(i))) > 1e-3;
    });
    if (involved) names += (names.empty() ? "" : ", ") + ShortName(robot, i);
  }
  words += names + " are not identifiable separately:";
  for (const Eigen::VectorXd& direction : found.null) {
    std::string moves;
    for (Eigen::Index i = 0; i < direction.size(); ++i) {
      if (std::abs(direction(i)) <= 1e-3) continue;
      const auto index = static_cast<size_t>(i);
      moves += fmt::format("{}{} {:+.3g}{}", moves.empty() ? "" : ", ", ShortName(robot, index), direction(i),
                           IsLog(robot, index) ? " %" : "");
    }
    words += " (" + moves + ") changes nothing";
  }
  return words;
}

}  // namespace

Identifiability FindIdentifiability(const RobotDescription& robot, Discrepancy& discrepancy,
                                    std::span<const Rollout> rollouts, const Gaussian& distribution) {
  const Eigen::Index n = distribution.mean.size();
  Eigen::VectorXd prior_sd(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    prior_sd(i) = std::sqrt(robot.parameters[static_cast<size_t>(i)].coordinate_variance());
  }
  Identifiability found;
  // The middle and both ends of each difference, all in one batch. Where one end is no simulator, as beyond friction 0,
  // the other one has to do.
  const Eigen::VectorXd h = 1e-4 * prior_sd;
  Eigen::MatrixXd physical(n, 2 * n + 1);
  for (Eigen::Index i = 0; i < n; ++i) {
    physical.col(2 * i) = robot.ToPhysical(distribution.mean + h(i) * Eigen::VectorXd::Unit(n, i));
    physical.col(2 * i + 1) = robot.ToPhysical(distribution.mean - h(i) * Eigen::VectorXd::Unit(n, i));
  }
  physical.col(2 * n) = robot.ToPhysical(distribution.mean);
  const Eigen::MatrixXd residuals = discrepancy.Residuals(physical, rollouts);
  Eigen::MatrixXd jacobian(residuals.rows(), n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto above = residuals.col(2 * i), below = residuals.col(2 * i + 1), middle = residuals.col(2 * n);
    if (above.allFinite() && below.allFinite()) {
      jacobian.col(i) = (above - below) / (2 * h(i));
    } else if (above.allFinite()) {
      jacobian.col(i) = (above - middle) / h(i);
    } else {
      jacobian.col(i) = (middle - below) / h(i);
    }
  }
  if (!jacobian.allFinite()) {
    found.information = Eigen::MatrixXd::Constant(n, n, std::numeric_limits<double>::quiet_NaN());
    found.words = "the simulation fails at the mean parameters, so nothing is known of what can be known";
    return found;
  }
  return FindIdentifiability(robot, jacobian.transpose() * jacobian, prior_sd, distribution);
}

Identifiability FindIdentifiability(const RobotDescription& robot, const Eigen::MatrixXd& information,
                                    const Eigen::VectorXd& prior_sd, const Gaussian& distribution) {
  const Eigen::Index n = distribution.mean.size();
  Identifiability found;
  found.information = information;
  const Eigen::MatrixXd scaled = prior_sd.asDiagonal() * found.information * prior_sd.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  const double threshold = kNull * eigen.eigenvalues()(n - 1);
  const Eigen::Index nulls = (eigen.eigenvalues().array() <= threshold).count();
  // Null directions are contravariant, combinations covariant: they scale inversely.
  const Eigen::MatrixXd null = prior_sd.asDiagonal() * eigen.eigenvectors().leftCols(nulls);
  const Eigen::MatrixXd determined = prior_sd.cwiseInverse().asDiagonal() * eigen.eigenvectors().rightCols(n - nulls);
  for (Eigen::Index i = 0; i < nulls; ++i) {
    Eigen::Index first = 0;
    while (std::abs(null(first, i)) < 1e-3 * null.col(i).cwiseAbs().maxCoeff()) ++first;
    found.null.push_back(null.col(i) / null(first, i));
  }
  const Eigen::MatrixXd precision =
      found.information + Eigen::MatrixXd(prior_sd.array().square().inverse().matrix().asDiagonal());
  for (const Eigen::VectorXd& power : SimplePowers(null.colwise().normalized(), determined, precision.inverse())) {
    Combination c{Name(robot, power), power, power.dot(distribution.mean),
                  std::sqrt(power.dot(distribution.covariance * power))};
    if (AllLog(robot, power)) {
      c.mean = std::exp(c.mean);
      c.sd *= c.mean;
    } else if ((power.array() != 0).count() == 1 && power.sum() == 1) {  // a parameter on its own: in its own units
      Eigen::Index index;
      power.maxCoeff(&index);
      const ParameterDescription& parameter = robot.parameters[static_cast<size_t>(index)];
      const double coordinate = c.mean, small = 1e-4 * prior_sd(index);
      c.mean = parameter.ToPhysical(coordinate);
      c.sd *= (parameter.ToPhysical(coordinate + small) - parameter.ToPhysical(coordinate - small)) / (2 * small);
    }
    found.combinations.push_back(std::move(c));
  }
  found.words = Words(robot, found);
  return found;
}

}  // namespace plumb
