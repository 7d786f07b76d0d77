#include "calibrator/diagnostics/error_tests.h"

#include <algorithm>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/poisson.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "calibrator/diagnostics/error_rows.h"
#include "calibrator/inference/chi_squared.h"
#include "common/decompositions.h"

namespace plumb {
namespace {

using boost::math::cdf;
using boost::math::complement;

constexpr int kFewestRows = 10;
constexpr int kLastLag = 6;

// Mean of absolute errors and its variance.
std::pair<double, double> AbsoluteMean(const ProjectedErrors& errors, const ErrorRows& rows) {
  double sum = 0, squares = 0;
  for (const Eigen::Index i : rows) sum += std::abs(errors.r(i));
  const auto count = static_cast<double>(rows.size());
  for (const Eigen::Index i : rows) squares += std::pow(std::abs(errors.r(i)) - sum / count, 2);
  return {sum / count, squares / (count - 1) / count};
}

// Errors in contact against free ones.
Misfit CompareConditions(const ProjectedErrors& errors, int coordinate, const ErrorRows& contact,
                         const ErrorRows& free) {
  const auto [contact_mean, contact_variance] = AbsoluteMean(errors, contact);
  const auto [free_mean, free_variance] = AbsoluteMean(errors, free);
  const double variance = contact_variance + free_variance;
  const double t = std::abs(contact_mean - free_mean) / std::sqrt(variance);
  const auto of = [](double v, const ErrorRows& rows) {
    return v * v / static_cast<double>(rows.size() - 1);
  };
  const double freedom =
      variance * variance / (of(contact_variance, contact) + of(free_variance, free));
  const double contact_squares = SumOfSquares(errors, contact),
               free_squares = SumOfSquares(errors, free);
  const auto c = static_cast<double>(contact.size()), f = static_cast<double>(free.size());
  const double calm = std::min(contact_squares / c, free_squares / f);
  const char* worse = contact_squares / c > free_squares / f ? "contact" : "free";
  return {errors.Place(CoordinateName(errors, coordinate), worse) + ": larger errors than else",
          JointOf(errors, coordinate),
          worse,
          "scale",
          t,
          2 * cdf(complement(boost::math::students_t(std::max(1.0, freedom)), t)),
          1 - calm * (c + f) / (contact_squares + free_squares)};
}

}  // namespace

std::vector<Misfit> TestScale(const ProjectedErrors& errors, const std::vector<bool>& noise_known) {
  std::vector<Misfit> tests;
  for (int joint = 0; joint < errors.n; ++joint) {
    for (const std::string& condition : Conditions(errors)) {
      const ErrorRows rows = RowsWhere(
          errors,
          [&](int c) { return c % errors.n == joint && noise_known[static_cast<size_t>(c)]; },
          condition);
      if (rows.size() < kFewestRows) continue;
      double freedom = 0;
      for (const Eigen::Index i : rows) freedom += errors.freedom(i);
      if (freedom < 1) continue;
      const double squares = SumOfSquares(errors, rows);
      const std::string& name = errors.joint_of[static_cast<size_t>(joint)];
      tests.push_back({errors.Place(name, condition) + ": errors beyond the noise", name, condition,
                       "scale", squares, ChiSquaredTail(freedom, squares),
                       std::max(0.0, 1 - freedom / squares)});
    }
  }
  for (int c = 0; c < 2 * errors.n && errors.conditions; ++c) {
    if (noise_known[static_cast<size_t>(c)]) continue;
    const auto own = [&](int other) { return other == c; };
    const ErrorRows contact = RowsWhere(errors, own, "contact"),
                    free = RowsWhere(errors, own, "free");
    if (contact.size() < kFewestRows || free.size() < kFewestRows) continue;
    // What rests has no errors that could be compared.
    if (SumOfSquares(errors, contact) + SumOfSquares(errors, free) == 0) continue;
    tests.push_back(CompareConditions(errors, c, contact, free));
  }
  return tests;
}

std::vector<Misfit> TestOutliers(const ProjectedErrors& errors) {
  std::vector<Misfit> tests;
  const double expected = 2 * cdf(complement(boost::math::normal(), kOutlier));
  for (int joint = 0; joint < errors.n; ++joint) {
    for (const std::string& condition : Conditions(errors)) {
      const ErrorRows rows = RowsWhere(
          errors, [&](int c) { return c % errors.n == joint; }, condition, /*outliers=*/true);
      if (rows.size() < kFewestRows) continue;
      ErrorRows out;
      std::copy_if(rows.begin(), rows.end(), std::back_inserter(out),
                   [&](Eigen::Index i) { return errors.outlying[static_cast<size_t>(i)]; });
      const auto counted = std::ranges::count_if(
          out, [&](Eigen::Index i) { return !errors.repeated[static_cast<size_t>(i)]; });
      const auto count = static_cast<double>(counted), all = static_cast<double>(rows.size());
      const double p =
          count == 0 ? 1 : cdf(complement(boost::math::poisson(all * expected), count - 1));
      const std::string& name = errors.joint_of[static_cast<size_t>(joint)];
      const std::string many =
          std::to_string(counted) + " of " + std::to_string(rows.size()) + " errors are outliers";
      tests.push_back({errors.Place(name, condition) + ": " + many, name, condition, "outliers",
                       count / all, p, SumOfSquares(errors, out) / SumOfSquares(errors, rows)});
    }
  }
  return tests;
}

namespace {

// Of the normalised correlations at successive lags from 2 on, if errors correlate by rho at lag 1
// and no further: Bartlett, J. R. Stat. Soc. Suppl. 8 (1946), sum_m rho_m rho_(m + j - k).
Eigen::MatrixXd LagCovariance(Eigen::Index lags, double rho) {
  constexpr double kMost =
      0.45;  // beyond 1/2 there is no such process, and at 1/2 a sum would have to vanish
  rho = std::clamp(rho, -kMost, kMost);
  const double band[] = {1 + 2 * rho * rho, 2 * rho, rho * rho};
  return Eigen::MatrixXd::NullaryExpr(lags, lags, [&](Eigen::Index j, Eigen::Index k) {
    return std::abs(j - k) < 3 ? band[std::abs(j - k)] : 0.0;
  });
}

}  // namespace

std::vector<Misfit> TestWhiteness(const ProjectedErrors& errors) {
  std::vector<Misfit> tests;
  for (int c = 0; c < 2 * errors.n; ++c) {
    if (errors.quiet[static_cast<size_t>(c)]) continue;
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(kLastLag), squares = sum, pairs = sum;
    double variance = 0, count = 0;
    bool shared = false;
    const auto usable = [&](int step) {
      const Eigen::Index row = errors.steps[static_cast<size_t>(step)].rows[static_cast<size_t>(c)];
      return row >= 0 && !errors.Out(row) ? row : -1;
    };
    for (int k = 0; k < static_cast<int>(errors.steps.size()); ++k) {
      const Eigen::Index row = usable(k);
      if (row < 0) continue;
      variance += errors.r(row) * errors.r(row);
      ++count;
      int other = k;
      for (int lag = 0; lag < kLastLag; ++lag) {
        shared = shared || errors.steps[static_cast<size_t>(other)].shares_state;
        other = errors.steps[static_cast<size_t>(other)].next;
        if (other < 0) break;
        const Eigen::Index later = usable(other);
        if (later < 0) continue;
        const double product = errors.r(row) * errors.r(later);
        sum(lag) += product;
        squares(lag) += product * product;
        ++pairs(lag);
      }
    }
    int first = shared ? 1 : 0, last = first;
    while (last < kLastLag && pairs(last) >= 3 * kFewestRows && squares(last) > 0) ++last;
    const Eigen::Index lags = last - first;
    if (lags == 0) continue;
    const auto correlation = [&](int lag) { return sum(lag) / pairs(lag) / (variance / count); };
    const Eigen::VectorXd z = (sum.array() / squares.array().sqrt()).segment(first, lags);
    const Eigen::MatrixXd covariance = LagCovariance(lags, shared ? correlation(0) : 0);
    const double statistic = z.dot(covariance.ldlt().solve(z));
    double predictable = 0;
    for (int lag = first; lag < last; ++lag) {
      // Less the expectation of chance alone.
      predictable += std::pow(correlation(lag), 2) - covariance(0, 0) / pairs(lag);
    }
    tests.push_back({CoordinateName(errors, c) + ": successive errors resemble each other",
                     JointOf(errors, c), "", "whiteness", statistic,
                     ChiSquaredTail(static_cast<double>(lags), statistic),
                     std::clamp(predictable, 0.0, 1.0)});
  }
  return tests;
}

std::vector<Misfit> TestBias(const ProjectedErrors& errors) {
  std::vector<Misfit> tests;
  for (int c = 0; c < 2 * errors.n; ++c) {
    if (errors.quiet[static_cast<size_t>(c)]) continue;
    for (const std::string& condition : Conditions(errors)) {
      const ErrorRows rows = RowsWhere(
          errors, [&](int other) { return other == c; }, condition);
      if (rows.size() < kFewestRows) continue;
      Eigen::VectorXd mean = Eigen::VectorXd::Zero(errors.r.size());
      for (const Eigen::Index i : rows) mean(i) = 1;
      const double infinity = std::numeric_limits<double>::infinity();
      const Score score =
          FindScore(errors, errors.Project(mean.cwiseProduct(errors.weight)), infinity, -infinity);
      tests.push_back(
          {errors.Place(CoordinateName(errors, c), condition) + ": errors are not zero on average",
           JointOf(errors, c), condition, "bias", score.statistic, score.p,
           std::min(1.0, score.gain / SumOfSquares(errors, rows))});
    }
  }
  return tests;
}

namespace {

// 1, and of each velocity u, v, |v| v, sign v, and of each position q, sin q, cos q.
Eigen::RowVectorXd Features(const ProjectedErrors::Step& step) {
  const Transition& t = *step.transition;
  const Eigen::VectorXd &q = step.q, &v = step.v;
  const Eigen::VectorXd effort = t.mean_effort();
  Eigen::RowVectorXd features(1 + 4 * v.size() + 3 * q.size());
  features << 1, effort.transpose(), v.transpose(),
      (v.array().abs() * v.array()).matrix().transpose(), v.array().sign().matrix().transpose(),
      q.transpose(), q.array().sin().matrix().transpose(), q.array().cos().matrix().transpose();
  return features;
}

}  // namespace

std::vector<Misfit> TestRegression(const ProjectedErrors& errors) {
  std::vector<Misfit> tests;
  for (int c = 0; c < 2 * errors.n; ++c) {
    if (errors.quiet[static_cast<size_t>(c)]) continue;
    const ErrorRows rows = RowsWhere(
        errors, [&](int other) { return other == c; }, "");
    if (rows.empty()) continue;
    const auto count = static_cast<Eigen::Index>(rows.size());
    Eigen::MatrixXd features(count, Features(errors.steps[0]).size());
    if (count < 5 * features.cols()) continue;
    Eigen::MatrixXd basis(count, errors.basis.cols());
    Eigen::VectorXd r(count);
    double leverage = 0;
    for (Eigen::Index k = 0; k < count; ++k) {
      const Eigen::Index row = rows[static_cast<size_t>(k)];
      features.row(k) =
          Features(errors.steps[static_cast<size_t>(errors.step_of[static_cast<size_t>(row)])]);
      basis.row(k) = errors.basis.row(row);
      r(k) = errors.r(row);
      leverage += 1 - errors.freedom(row);
    }
    for (auto feature : features.colwise()) {
      if (feature.norm() > 0) feature.normalize();
    }
    // (P F)' (P F) with P the projection: only this coordinate's rows of the basis meet those of F.
    const Eigen::MatrixXd overlap = basis.transpose() * features;
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> gram(
        Eigen::MatrixXd(features.transpose() * features - overlap.transpose() * overlap));
    const Eigen::VectorXd score = gram.eigenvectors().transpose() * (features.transpose() * r);
    double explained = 0, used = 0;
    for (Eigen::Index i = 0; i < score.size(); ++i) {
      if (gram.eigenvalues()(i) < 1e-6) continue;
      explained += score(i) * score(i) / gram.eigenvalues()(i);
      ++used;
    }
    const double left = static_cast<double>(count) - used - leverage,
                 rest = r.squaredNorm() - explained;
    if (left < 1 || used == 0 || !(rest > 0)) continue;
    const double f = explained / used / (rest / left);
    tests.push_back({CoordinateName(errors, c) + ": errors depend on state and effort",
                     JointOf(errors, c), "", "structure", f,
                     cdf(complement(boost::math::fisher_f(used, left), f)),
                     std::clamp((explained - used * rest / left) / r.squaredNorm(), 0.0, 1.0)});
  }
  return tests;
}

}  // namespace plumb
