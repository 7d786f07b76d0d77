#include "robot/parameter_distribution.h"

#include <algorithm>
#include <cmath>

#include "common/decompositions.h"

namespace plumb {
namespace {

using Coordinate = ParameterDescription::Coordinate;

/// First and second moment of one parameter, in physical units.
struct RawMoments {
  double mean, square;
};

// The moments of a logistic function of a normal variable have no closed form. The trapezoidal rule
// converges exponentially, as the integrand is analytic and gone at the ends; beyond sd 8, where
// all is at the bounds, slower.
RawMoments LogitMoments(double mean, double sd, const ParameterDescription& parameter) {
  constexpr int kEnd = 9, kPointsPerSd = 16;
  RawMoments sum{0, 0};
  double total = 0;
  for (int i = -kEnd * kPointsPerSd; i <= kEnd * kPointsPerSd; ++i) {
    const double z = static_cast<double>(i) / kPointsPerSd;
    const double weight = std::exp(-z * z / 2), value = parameter.ToPhysical(mean + sd * z);
    total += weight;
    sum.mean += weight * value;
    sum.square += weight * value * value;
  }
  return {sum.mean / total, sum.square / total};
}

RawMoments PhysicalMoments(const Gaussian& component, Eigen::Index i,
                           const ParameterDescription& parameter) {
  const double mean = component.mean[i], variance = component.covariance(i, i);
  switch (parameter.coordinate) {
    case Coordinate::kLog:
      return {std::exp(mean + variance / 2), std::exp(2 * mean + 2 * variance)};
    case Coordinate::kLogit:
      return LogitMoments(mean, std::sqrt(std::max(0., variance)), parameter);
    default:
      return {mean, variance + mean * mean};
  }
}

RawMoments PhysicalMoments(const GaussianMixture& mixture, Eigen::Index i,
                           const ParameterDescription& parameter) {
  RawMoments sum{0, 0};
  for (size_t k = 0; k < mixture.components.size(); ++k) {
    const RawMoments moments = PhysicalMoments(mixture.components[k], i, parameter);
    sum.mean += mixture.weights[k] * moments.mean;
    sum.square += mixture.weights[k] * moments.square;
  }
  return sum;
}

}  // namespace

Gaussian PriorGaussian(const RobotDescription& description) {
  const auto size = static_cast<Eigen::Index>(description.parameters.size());
  Gaussian prior{Eigen::VectorXd(size), Eigen::MatrixXd::Zero(size, size)};
  for (Eigen::Index i = 0; i < size; ++i) {
    const ParameterDescription& parameter = description.parameters[static_cast<size_t>(i)];
    prior.mean[i] = parameter.coordinate_mean();
    prior.covariance(i, i) = parameter.coordinate_variance();
  }
  return prior;
}

ParameterDistribution ParameterDistribution::Prior(const RobotDescription& description) {
  return {0, description.parameters, {{1}, {PriorGaussian(description)}}};
}

ParameterDistribution ParameterDistribution::Nominal(const RobotDescription& description) {
  ParameterDistribution distribution = Prior(description);
  Gaussian& only = distribution.mixture.components[0];
  for (Eigen::Index i = 0; i < only.mean.size(); ++i) {
    const ParameterDescription& parameter = description.parameters[static_cast<size_t>(i)];
    only.mean[i] = parameter.ToCoordinate(parameter.mean);
  }
  only.covariance.setZero();
  return distribution;
}

Eigen::VectorXd ParameterDistribution::SampleCoordinates(Random& random) const {
  const Gaussian& component = mixture.components[SampleComponent(mixture, random)];
  if (size() == 0) return component.mean;

  // Not Cholesky: a parameter known exactly, or exactly tied to another, makes the covariance
  // singular.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(component.covariance);
  Eigen::VectorXd normal(size());
  for (double& value : normal) value = random.Normal();
  return component.mean +
         eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).cwiseSqrt().cwiseProduct(normal);
}

SimulatorDraw ParameterDistribution::Draw(Random& random) const {
  SimulatorDraw draw{Eigen::VectorXd()};
  if (!residual || random.Uniform() < kPlainShare) {
    draw.parameters = Sample(random);
  } else {
    draw.draw = random.Below(residual->coordinates.size());
    draw.parameters = ToPhysical(residual->coordinates[draw.draw]);
    draw.residual = residual;
  }
  if (!starts.empty() && random.Uniform() < kRecordedStarts)
    draw.start = starts[random.Below(starts.size())];
  return draw;
}

Eigen::VectorXd ParameterDistribution::Sample(Random& random) const {
  return ToPhysical(SampleCoordinates(random));
}

Eigen::VectorXd ParameterDistribution::ToPhysical(const Eigen::VectorXd& coordinates) const {
  return plumb::ToPhysical(parameters, coordinates);
}

Eigen::VectorXd ParameterDistribution::Mean() const {
  Eigen::VectorXd mean(size());
  for (Eigen::Index i = 0; i < mean.size(); ++i)
    mean[i] = PhysicalMoments(mixture, i, parameters[static_cast<size_t>(i)]).mean;
  return mean;
}

Eigen::VectorXd ParameterDistribution::Sd() const {
  Eigen::VectorXd sd(size());
  for (Eigen::Index i = 0; i < sd.size(); ++i) {
    const RawMoments m = PhysicalMoments(mixture, i, parameters[static_cast<size_t>(i)]);
    sd[i] = std::sqrt(std::max(0., m.square - m.mean * m.mean));
  }
  return sd;
}

}  // namespace plumb
