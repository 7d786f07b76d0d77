#include "calibrator/diagnostics/identifiability.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "calibrator/diagnostics/identifiability_summary.h"
#include "calibrator/diagnostics/sparse_basis.h"
#include "common/decompositions.h"
#include "common/special_numbers.h"

namespace plumb {
namespace {

constexpr double kNull = 1e-6;             // of the largest information, in units of the prior
constexpr double kNullInformation = 1e-2;  // and of the prior's
constexpr double kWeakInformation = 1;     // of the prior's
// of the largest in a weak direction: smaller ones are not told
constexpr double kWeakEntry = 0.2;
constexpr int kLargestPower = 2;
constexpr Eigen::Index kMaxTried = 6;  // parameters of which all small powers are tried

using Vectors = std::vector<Eigen::VectorXd>;

// Every vector of small integer powers with its first entry positive, fewest and smallest powers
// first.
std::vector<Eigen::VectorXd> SmallPowers(Eigen::Index n) {
  std::vector<Eigen::VectorXd> powers;
  const size_t base = 2 * size_t{kLargestPower} + 1;
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

// A power of a parameter of the whole robot, such as gravity, is less telling than one of a link's
// or joint's own.
Eigen::VectorXd CostOfPowers(const RobotDescription& robot) {
  Eigen::VectorXd cost(static_cast<Eigen::Index>(robot.parameters.size()));
  for (size_t i = 0; i < robot.parameters.size(); ++i) {
    cost(static_cast<Eigen::Index>(i)) =
        robot.parameters[i].name.find('/') == std::string::npos ? 2 : 1;
  }
  return cost;
}

// Fewest and cheapest powers first.
void SortBySimplicity(const Eigen::MatrixXd& covariance, const Eigen::VectorXd& cost,
                      Vectors* powers) {
  std::stable_sort(powers->begin(), powers->end(),
                   [&](const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
                     const auto key = [&](const Eigen::VectorXd& p) {
                       return std::make_tuple((p.array() != 0).count(), p.cwiseAbs().dot(cost),
                                              p.dot(covariance * p));
                     };
                     return key(a) < key(b);
                   });
}

// Parameters that null directions couple, in groups. Those that none involves are none's.
std::vector<std::vector<Eigen::Index>> CoupledGroups(const Vectors& null, Eigen::Index n) {
  std::vector<Eigen::Index> group(static_cast<size_t>(n));
  std::iota(group.begin(), group.end(), 0);
  std::vector<bool> involved(static_cast<size_t>(n), false);
  for (const Eigen::VectorXd& direction : null) {
    Eigen::Index first = -1;
    for (Eigen::Index i = 0; i < n; ++i) {
      if (direction(i) == 0) continue;
      involved[static_cast<size_t>(i)] = true;
      if (first < 0) first = group[static_cast<size_t>(i)];
      std::replace(group.begin(), group.end(), Eigen::Index{group[static_cast<size_t>(i)]}, first);
    }
  }
  std::vector<std::vector<Eigen::Index>> groups(static_cast<size_t>(n));
  for (Eigen::Index i = 0; i < n; ++i) {
    if (involved[static_cast<size_t>(i)])
      groups[static_cast<size_t>(group[static_cast<size_t>(i)])].push_back(i);
  }
  std::erase_if(groups, [](const auto& members) { return members.empty(); });
  return groups;
}

// Combinations of a group's parameters that no null direction changes: a basis of all of them, of
// the simplest form.
Vectors SimplePowers(const Eigen::MatrixXd& null, const Eigen::MatrixXd& covariance,
                     const Eigen::VectorXd& prior_sd, const Eigen::VectorXd& cost) {
  const Eigen::Index n = null.rows(), rank = n - null.cols();
  if (rank == 0) return {};
  const auto unchanged = [&](const Eigen::VectorXd& power) {
    return (null.transpose() * power).norm() < 1e-3 * power.norm();
  };
  Vectors chosen;
  if (n <= kMaxTried) {
    Vectors candidates = SmallPowers(n);
    std::erase_if(candidates, [&](const Eigen::VectorXd& power) { return !unchanged(power); });
    SortBySimplicity(covariance, cost, &candidates);
    Eigen::MatrixXd basis(n, 0);
    for (const Eigen::VectorXd& candidate : candidates) {
      Eigen::MatrixXd extended(n, basis.cols() + 1);
      extended << basis, candidate;
      if (extended.fullPivHouseholderQr().rank() < extended.cols()) continue;
      basis = extended;
      chosen.push_back(candidate);
      if (basis.cols() == rank) return chosen;
    }
  }
  // Combinations are covariant: what counts as one is the inverse of a parameter's unit.
  const Eigen::MatrixXd complement =
      FirstColumns(Eigen::HouseholderQR<Eigen::MatrixXd>(null).householderQ(), n).rightCols(rank);
  return SparseBasis(complement, prior_sd.cwiseInverse(), unchanged);
}

// Of all parameters.
Vectors AllPowers(const Vectors& null, const Eigen::MatrixXd& covariance,
                  const Eigen::VectorXd& prior_sd, const Eigen::VectorXd& cost) {
  const Eigen::Index n = prior_sd.size();
  Vectors powers;
  std::vector<bool> involved(static_cast<size_t>(n), false);
  for (const auto& members : CoupledGroups(null, n)) {
    const auto size = static_cast<Eigen::Index>(members.size());
    for (const Eigen::Index member : members) involved[static_cast<size_t>(member)] = true;
    Eigen::MatrixXd own(size, 0);
    for (const Eigen::VectorXd& direction : null) {
      if (direction(members).isZero(0)) continue;
      own.conservativeResize(Eigen::NoChange, own.cols() + 1);
      own.col(own.cols() - 1) = direction(members).normalized();
    }
    for (const Eigen::VectorXd& power :
         SimplePowers(own, covariance(members, members), prior_sd(members), cost(members))) {
      powers.push_back(Eigen::VectorXd::Zero(n));
      powers.back()(members) = power;
    }
  }
  if (null.empty()) {
    for (Eigen::Index i = 0; i < n; ++i) powers.push_back(Eigen::VectorXd::Unit(n, i));
    return powers;
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    if (!involved[static_cast<size_t>(i)]) powers.push_back(Eigen::VectorXd::Unit(n, i));
  }
  SortBySimplicity(covariance, cost, &powers);
  return powers;
}

Combination Describe(const RobotDescription& robot, const Eigen::VectorXd& power,
                     const Eigen::VectorXd& prior_sd, const Gaussian& distribution) {
  Combination c{CombinationName(robot, power), power, power.dot(distribution.mean),
                std::sqrt(power.dot(distribution.covariance * power))};
  if (AllLog(robot, power)) {
    c.mean = std::exp(c.mean);
    c.sd *= c.mean;
  } else if ((power.array() != 0).count() == 1 &&
             power.sum() == 1) {  // a parameter on its own: in its own units
    Eigen::Index index;
    power.maxCoeff(&index);
    const ParameterDescription& parameter = robot.parameters[static_cast<size_t>(index)];
    const double coordinate = c.mean, small = 1e-4 * prior_sd(index);
    c.mean = parameter.ToPhysical(coordinate);
    c.sd *= (parameter.ToPhysical(coordinate + small) - parameter.ToPhysical(coordinate - small)) /
            (2 * small);
  }
  return c;
}

// Directions between null and determined. Parameters of which the data would say little even if all
// others were known come on their own; what else is weak in what is left.
std::vector<WeakDirection> FindWeak(const Eigen::MatrixXd& information,
                                    const Eigen::VectorXd& prior_sd,
                                    const Eigen::MatrixXd& scaled_weak, const Vectors& null) {
  const Eigen::Index n = prior_sd.size();
  std::vector<WeakDirection> weak;
  const Eigen::MatrixXd precision =
      information + Eigen::MatrixXd(prior_sd.array().square().inverse().matrix().asDiagonal());
  const Eigen::MatrixXd covariance = Inverse(precision);
  Eigen::MatrixXd told(n, 0);  // scaled, orthonormal
  for (Eigen::Index i = 0; i < n && static_cast<Eigen::Index>(weak.size()) < scaled_weak.cols();
       ++i) {
    const bool involved = std::any_of(null.begin(), null.end(),
                                      [&](const auto& direction) { return direction(i) != 0; });
    if (involved || information(i, i) * prior_sd(i) * prior_sd(i) >= kWeakInformation) continue;
    weak.push_back({Eigen::VectorXd::Unit(n, i), std::sqrt(covariance(i, i)) / prior_sd(i)});
    told.conservativeResize(Eigen::NoChange, told.cols() + 1);
    told.col(told.cols() - 1) = Eigen::VectorXd::Unit(n, i);
  }
  const Eigen::Index rest = scaled_weak.cols() - told.cols();
  if (rest == 0) return weak;
  const Eigen::MatrixXd left = scaled_weak - told * (told.transpose() * scaled_weak);
  const Eigen::MatrixXd directions =
      Eigen::JacobiSVD<Eigen::MatrixXd>(left, Eigen::ComputeThinU).matrixU().leftCols(rest);
  for (const auto scaled : directions.colwise()) {
    const double along =
        scaled.dot(prior_sd.asDiagonal() * information * prior_sd.asDiagonal() * scaled);
    Eigen::VectorXd direction =
        (scaled.array().abs() < kWeakEntry * scaled.cwiseAbs().maxCoeff()).select(0, scaled);
    direction = direction.cwiseProduct(prior_sd);
    Eigen::Index largest;
    direction.cwiseAbs().maxCoeff(&largest);
    weak.push_back({direction / direction(largest), 1 / std::sqrt(1 + along)});
  }
  return weak;
}

}  // namespace

double NullInformation(double largest) { return std::min(kNull * largest, kNullInformation); }

Identifiability FindIdentifiability(const RobotDescription& robot,
                                    const Eigen::MatrixXd& information,
                                    const Eigen::VectorXd& prior_sd, const Gaussian& distribution) {
  const Eigen::Index n = distribution.mean.size();
  Identifiability found;
  found.information = information;
  found.cramer_rao = Eigen::VectorXd::Constant(n, kInfinity);
  if (!information.allFinite()) {
    found.information.setConstant(kNaN);
    found.summary =
        "the simulation fails at the mean parameters, so nothing is known of what can be known";
    return found;
  }
  // In units of the prior. Directions are contravariant, combinations covariant: they scale
  // inversely.
  const Eigen::MatrixXd scaled = prior_sd.asDiagonal() * information * prior_sd.asDiagonal();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled);
  const Eigen::ArrayXd along = eigen.eigenvalues();
  const double threshold = NullInformation(along(n - 1));
  const Eigen::Index nulls = (along <= threshold).count();
  const Eigen::Index weak = std::max<Eigen::Index>(0, (along < kWeakInformation).count() - nulls);
  found.null = SparseBasis(prior_sd.asDiagonal() * eigen.eigenvectors().leftCols(nulls), prior_sd,
                           [&](const Eigen::VectorXd& direction) {
                             const Eigen::VectorXd unit =
                                 direction.cwiseQuotient(prior_sd).normalized();
                             return unit.dot(scaled * unit) <= 3 * threshold;
                           });
  const Eigen::MatrixXd determined =
      prior_sd.asDiagonal() * eigen.eigenvectors().rightCols(n - nulls);
  const Eigen::MatrixXd bound =
      determined * along.tail(n - nulls).inverse().matrix().asDiagonal() * determined.transpose();
  for (Eigen::Index i = 0; i < n; ++i) {
    const bool involved =
        std::any_of(found.null.begin(), found.null.end(), [&](const auto& d) { return d(i) != 0; });
    if (!involved) found.cramer_rao(i) = std::sqrt(bound(i, i));
  }
  const Eigen::MatrixXd precision =
      information + Eigen::MatrixXd(prior_sd.array().square().inverse().matrix().asDiagonal());
  for (const Eigen::VectorXd& power :
       AllPowers(found.null, Inverse(precision), prior_sd, CostOfPowers(robot))) {
    found.combinations.push_back(Describe(robot, power, prior_sd, distribution));
  }
  found.weak =
      FindWeak(information, prior_sd, eigen.eigenvectors().middleCols(nulls, weak), found.null);
  found.summary = IdentifiabilitySummary(robot, distribution.mean, found);
  return found;
}

Eigen::MatrixXd StepInformation(const RobotDescription& robot, Discrepancy& discrepancy,
                                std::span<const Rollout> rollouts,
                                const Eigen::VectorXd& coordinates, const Eigen::VectorXd& h) {
  const Eigen::Index n = coordinates.size();
  Eigen::MatrixXd physical(n, 2 * n + 1);  // ends and middle, all in one batch
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::VectorXd step = h(i) * Eigen::VectorXd::Unit(n, i);
    physical.col(2 * i) = robot.ToPhysical(coordinates + step);
    physical.col(2 * i + 1) = robot.ToPhysical(coordinates - step);
  }
  physical.col(2 * n) = robot.ToPhysical(coordinates);
  const Eigen::MatrixXd errors = discrepancy.Residuals(physical, rollouts);
  Eigen::MatrixXd jacobian(errors.rows(), n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const auto above = errors.col(2 * i), below = errors.col(2 * i + 1), middle = errors.col(2 * n);
    if (above.allFinite() && below.allFinite())
      jacobian.col(i) = (above - below) / (2 * h(i));
    else
      jacobian.col(i) = (above.allFinite() ? above - middle : middle - below) / h(i);
  }
  return jacobian.transpose() * jacobian;
}

Identifiability FindIdentifiability(const RobotDescription& robot, Discrepancy& discrepancy,
                                    std::span<const Rollout> rollouts,
                                    const Gaussian& distribution) {
  Eigen::VectorXd prior_sd(distribution.mean.size());
  for (Eigen::Index i = 0; i < prior_sd.size(); ++i)
    prior_sd(i) = std::sqrt(robot.parameters[static_cast<size_t>(i)].coordinate_variance());
  return FindIdentifiability(
      robot, StepInformation(robot, discrepancy, rollouts, distribution.mean, 1e-4 * prior_sd),
      prior_sd, distribution);
}

}  // namespace plumb
