#include "calibrator/inference/prior.h"

#include <boost/math/special_functions/erf.hpp>
#include <cmath>
#include <stdexcept>

#include "calibrator/inference/slopes.h"
#include "common/gaussian.h"
#include "common/special_numbers.h"

namespace plumb {
namespace {

// Inverse of NormalCdf, accurate in both tails.
double NormalQuantile(double p) {
  if (!(p > 0)) return -kInfinity;
  if (!(p < 1)) return kInfinity;
  return -M_SQRT2 * boost::math::erfc_inv(2 * p);
}

double ToStandard(const Prior::Marginal& marginal, double x) {
  if (marginal.kind == Prior::Marginal::Kind::kNormal) return (x - marginal.a) / marginal.b;
  const double below = (x - marginal.a) / (marginal.b - marginal.a);
  return below < 0.5 ? NormalQuantile(below)
                     : -NormalQuantile((marginal.b - x) / (marginal.b - marginal.a));
}

double FromStandard(const Prior::Marginal& marginal, double u) {
  if (marginal.kind == Prior::Marginal::Kind::kNormal) return marginal.a + marginal.b * u;
  const double width = marginal.b - marginal.a;
  return u < 0 ? marginal.a + width * NormalCdf(u) : marginal.b - width * NormalCdf(-u);
}

}  // namespace

Prior::Prior(std::vector<Marginal> marginals) : marginals_(std::move(marginals)) {
  if (marginals_.empty()) throw std::invalid_argument("a prior needs at least one parameter");
  for (const Marginal& m : marginals_) {
    const bool good = std::isfinite(m.a) && std::isfinite(m.b) &&
                      (m.kind == Marginal::Kind::kNormal ? m.b > 0 : m.a < m.b);
    if (!good)
      throw std::invalid_argument(
          "a prior needs finite numbers, a positive spread or bounds in order");
  }
}

Eigen::MatrixXd Prior::ToStandard(const Eigen::MatrixXd& x) const {
  Eigen::MatrixXd u(x.rows(), x.cols());
  for (Eigen::Index i = 0; i < x.rows(); ++i) {
    for (Eigen::Index j = 0; j < x.cols(); ++j)
      u(i, j) = plumb::ToStandard(marginals_[static_cast<size_t>(i)], x(i, j));
  }
  return u;
}

Eigen::MatrixXd Prior::FromStandard(const Eigen::MatrixXd& u) const {
  Eigen::MatrixXd x(u.rows(), u.cols());
  for (Eigen::Index i = 0; i < u.rows(); ++i) {
    for (Eigen::Index j = 0; j < u.cols(); ++j)
      x(i, j) = plumb::FromStandard(marginals_[static_cast<size_t>(i)], u(i, j));
  }
  return x;
}

Eigen::VectorXd Prior::Slope(const Eigen::VectorXd& u) const {
  return (FromStandard(u.array() + kSlopeDifference) - FromStandard(u.array() - kSlopeDifference)) /
         (2 * kSlopeDifference);
}

Eigen::VectorXd Prior::Width() const {
  const Eigen::VectorXd one = Eigen::VectorXd::Ones(size());
  return (FromStandard(one) - FromStandard(-one)) / 2;
}

double Prior::LogDensity(const Eigen::VectorXd& x) const {
  double sum = 0;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const Marginal& m = marginals_[static_cast<size_t>(i)];
    if (m.kind == Marginal::Kind::kUniform) {
      sum += x(i) >= m.a && x(i) <= m.b ? -std::log(m.b - m.a) : -kInfinity;
    } else {
      const double u = (x(i) - m.a) / m.b;
      sum += -0.5 * u * u - std::log(m.b) - 0.5 * std::log(2 * M_PI);
    }
  }
  return sum;
}

Eigen::MatrixXd Prior::Sample(Eigen::Index count, Random& random) const {
  return FromStandard(StandardNormals(size(), count, random));
}

}  // namespace plumb
