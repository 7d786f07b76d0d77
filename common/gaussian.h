#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/random.h"

namespace plumb {

/// A normal distribution of n numbers. All functions of this header are thread-safe.
struct Gaussian {
  Eigen::VectorXd mean;        ///< n
  Eigen::MatrixXd covariance;  ///< n x n, symmetric, positive definite

  bool operator==(const Gaussian&) const = default;
};

/// A sum of K normal distributions.
struct GaussianMixture {
  std::vector<double> weights;       ///< K, > 0, sum to 1
  std::vector<Gaussian> components;  ///< K, of the same n

  bool operator==(const GaussianMixture&) const = default;
};

/// Probability that a standard normal deviate is less than u, accurate in both tails.
double NormalCdf(double u);

/// ln p(x). @throws std::invalid_argument if the covariance is not positive definite (also below).
double LogDensity(const Gaussian& p, const Eigen::VectorXd& x);

/// D_KL(p || q) [nat] = (tr(S_q^-1 S_p) + d' S_q^-1 d - n + ln det S_q - ln det S_p) / 2, d = m_q -
/// m_p.
double KlDivergence(const Gaussian& p, const Gaussian& q);

/// Inverse of the covariance.
Eigen::MatrixXd Precision(const Gaussian& p);

/// n x N matrix of samples from a matrix of standard normal deviates: mean + chol(covariance) *
/// normals.
Eigen::MatrixXd Transform(const Gaussian& p, const Eigen::MatrixXd& normals);

/// The Gaussian with the mixture's mean and covariance.
Gaussian Moments(const GaussianMixture& mixture);

/// A matrix of standard normal deviates, column by column.
Eigen::MatrixXd StandardNormals(Eigen::Index rows, Eigen::Index columns, Random& random);

/// Draws a component in proportion to the weights. @return its index.
size_t SampleComponent(const GaussianMixture& mixture, Random& random);

/// One draw.
Eigen::VectorXd Sample(const GaussianMixture& mixture, Random& random);

}  // namespace plumb
