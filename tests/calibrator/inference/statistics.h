#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <vector>

namespace plumb {

/// p of so large a distance between the samples' distribution function and a normal one
/// (Kolmogorov's asymptotic law).
inline double KolmogorovSmirnov(const Eigen::VectorXd& samples, double mean, double sd) {
  std::vector<double> sorted(samples.begin(), samples.end());
  std::sort(sorted.begin(), sorted.end());
  const double n = static_cast<double>(sorted.size());
  double distance = 0;
  for (size_t i = 0; i < sorted.size(); ++i) {
    const double f = 0.5 * std::erfc(-(sorted[i] - mean) / sd / std::sqrt(2.0));
    distance =
        std::max({distance, f - static_cast<double>(i) / n, static_cast<double>(i + 1) / n - f});
  }
  const double lambda = (std::sqrt(n) + 0.12 + 0.11 / std::sqrt(n)) * distance;
  double p = 0;
  for (int k = 1; k < 100; ++k) p += (k % 2 ? 2 : -2) * std::exp(-2.0 * k * k * lambda * lambda);
  return lambda < 0.2 ? 1 : std::clamp(p, 0.0, 1.0);
}

/// p of a chi-squared statistic as far out, to either side.
inline double ChiSquared(double statistic, double degrees) {
  const boost::math::chi_squared law(degrees);
  const double below = boost::math::cdf(law, statistic);
  return 2 * std::min(below, boost::math::cdf(boost::math::complement(law, statistic)));
}

}  // namespace plumb
