#include "common/gaussian.h"

#include <cmath>
#include <stdexcept>

#include "common/decompositions.h"

namespace plumb {
namespace {

Eigen::LLT<Eigen::MatrixXd> Factor(const Gaussian& p) {
  Eigen::LLT<Eigen::MatrixXd> factor(p.covariance);
  if (factor.info() != Eigen::Success)
    throw std::invalid_argument("covariance is not positive definite");
  return factor;
}

double LogDeterminant(const Eigen::LLT<Eigen::MatrixXd>& factor) {
  return 2 * factor.matrixLLT().diagonal().array().log().sum();
}

}  // namespace

double NormalCdf(double u) { return 0.5 * std::erfc(-u * M_SQRT1_2); }

double LogDensity(const Gaussian& p, const Eigen::VectorXd& x) {
  const auto factor = Factor(p);
  const double n = static_cast<double>(x.size());
  return -0.5 * (factor.matrixL().solve(x - p.mean).squaredNorm() + LogDeterminant(factor) +
                 n * std::log(2 * M_PI));
}

double KlDivergence(const Gaussian& p, const Gaussian& q) {
  const auto p_factor = Factor(p), q_factor = Factor(q);
  const double n = static_cast<double>(p.mean.size());
  const Eigen::VectorXd difference = q.mean - p.mean;
  return 0.5 * (q_factor.solve(p.covariance).trace() + difference.dot(q_factor.solve(difference)) -
                n + LogDeterminant(q_factor) - LogDeterminant(p_factor));
}

Eigen::MatrixXd Precision(const Gaussian& p) {
  return Factor(p).solve(Eigen::MatrixXd::Identity(p.mean.size(), p.mean.size()));
}

Eigen::MatrixXd Transform(const Gaussian& p, const Eigen::MatrixXd& normals) {
  return (Factor(p).matrixL() * normals).colwise() + p.mean;
}

Gaussian Moments(const GaussianMixture& mixture) {
  const Eigen::Index n = mixture.components.at(0).mean.size();
  Gaussian moments{Eigen::VectorXd::Zero(n), Eigen::MatrixXd::Zero(n, n)};
  for (size_t i = 0; i < mixture.components.size(); ++i) {
    moments.mean += mixture.weights[i] * mixture.components[i].mean;
  }
  for (size_t i = 0; i < mixture.components.size(); ++i) {
    const Eigen::VectorXd offset = mixture.components[i].mean - moments.mean;
    moments.covariance +=
        mixture.weights[i] * (mixture.components[i].covariance + offset * offset.transpose());
  }
  return moments;
}

Eigen::MatrixXd StandardNormals(Eigen::Index rows, Eigen::Index columns, Random& random) {
  Eigen::MatrixXd normals(rows, columns);
  for (Eigen::Index j = 0; j < columns; ++j) {
    for (Eigen::Index i = 0; i < rows; ++i) normals(i, j) = random.Normal();
  }
  return normals;
}

size_t SampleComponent(const GaussianMixture& mixture, Random& random) {
  double left = random.Uniform();
  size_t i = 0;
  while (i + 1 < mixture.components.size() && left >= mixture.weights[i])
    left -= mixture.weights[i++];
  return i;
}

Eigen::VectorXd Sample(const GaussianMixture& mixture, Random& random) {
  const Gaussian& component = mixture.components[SampleComponent(mixture, random)];
  return Transform(component, StandardNormals(component.mean.size(), 1, random));
}

}  // namespace plumb
