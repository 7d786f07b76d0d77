// Of parameter_distribution.h: as a message, and what a message must not say.

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "common/decompositions.h"
#include "common/outside_text.h"
#include "common/special_numbers.h"
#include "robot/configuration_space.h"
#include "robot/parameter_distribution.h"
#include "robot/physical.h"
#include "robot/residual_message.h"

namespace plumb {
namespace {

using Coordinate = ParameterDescription::Coordinate;

int8_t ToCode(Coordinate coordinate) {
  switch (coordinate) {
    case Coordinate::kLog:
      return parameter_distribution_t::LOG;
    case Coordinate::kLogit:
      return parameter_distribution_t::LOGIT;
    default:
      return parameter_distribution_t::LINEAR;
  }
}

[[noreturn]] void Reject(const std::string& what) {
  throw std::invalid_argument("parameter distribution: " + Printable(what));
}

void RequireSize(const char* what, int64_t announced, size_t actual, int64_t expected) {
  if (announced != expected || actual != static_cast<size_t>(expected)) {
    Reject(fmt::format("{} {}, expected {}", announced, what, expected));
  }
}

void RequireSameParameters(const parameter_distribution_t& message,
                           const RobotDescription& description) {
  const auto count = static_cast<int64_t>(description.parameters.size());
  RequireSize("parameters", message.num_parameters, message.name.size(), count);
  RequireSize("coordinates", message.num_parameters, message.coordinate.size(), count);
  for (size_t i = 0; i < description.parameters.size(); ++i) {
    const ParameterDescription& expected = description.parameters[i];
    if (message.name[i] != expected.name) {
      Reject(fmt::format("parameter {} is '{}', {} has '{}' there", i,
                         message.name[i].substr(0, 80), description.name, expected.name));
    }
    if (message.coordinate[i] != ToCode(expected.coordinate)) {
      Reject(fmt::format("coordinate of '{}' is not that of {}", expected.name, description.name));
    }
  }
}

// Nobody's posterior is so far from the prior, or so wide: [sd] of the prior.
constexpr double kFarthest = 1000, kWidest = 100;

// In coordinates, of each parameter apart, so that it and the field can be named.
void RequireNearPrior(const Eigen::VectorXd& coordinates, const char* field,
                      const RobotDescription& robot) {
  const Gaussian prior = PriorGaussian(robot);
  for (Eigen::Index i = 0; i < coordinates.size(); ++i) {
    const double sds = std::abs(coordinates[i] - prior.mean[i]) / std::sqrt(prior.covariance(i, i));
    if (sds > kFarthest)
      Reject(fmt::format("the {} of '{}' is {:.3g} standard deviations of the prior away from it",
                         field, robot.parameters[static_cast<size_t>(i)].name, sds));
  }
}

void RequireNarrow(const Eigen::MatrixXd& covariance, const RobotDescription& robot) {
  const Gaussian prior = PriorGaussian(robot);
  for (Eigen::Index i = 0; i < covariance.rows(); ++i) {
    const double times = covariance(i, i) / prior.covariance(i, i);
    if (times > kWidest * kWidest)
      Reject(fmt::format("the variance of '{}' is {:.3g} times the prior's",
                         robot.parameters[static_cast<size_t>(i)].name, times));
  }
}

// As they are, and as simulators have them.
void RequirePlausible(const ParameterDistribution& distribution, const RobotDescription& robot) {
  for (const Gaussian& component : distribution.mixture.components) {
    RequireNearPrior(component.mean, "mean", robot);
    RequireNarrow(component.covariance, robot);
  }
  const Eigen::VectorXd means = distribution.Mean(), sds = distribution.Sd();
  for (Eigen::Index i = 0; i < means.size(); ++i) {
    if (!(std::abs(means[i]) <= kGreatestParameter) || !(sds[i] <= kGreatestParameter))
      Reject(fmt::format("'{}' is {} with a standard deviation of {}",
                         robot.parameters[static_cast<size_t>(i)].name, means[i], sds[i]));
  }
}

void RequireCovariance(const Eigen::MatrixXd& covariance) {
  const double scale = covariance.cwiseAbs().maxCoeff();
  if ((covariance - covariance.transpose()).cwiseAbs().maxCoeff() >
      ParameterDistribution::kRounding * scale) {
    Reject("covariance is not symmetric");
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance, Eigen::EigenvaluesOnly);
  if (eigen.info() != Eigen::Success ||
      eigen.eigenvalues().minCoeff() < -ParameterDistribution::kRounding * scale) {
    Reject("covariance is not positive semidefinite");
  }
}

}  // namespace

ParameterDistribution ParameterDistribution::FromMessage(const parameter_distribution_t& message,
                                                         const RobotDescription& description) {
  RequireSameParameters(message, description);
  if (message.iteration < 0) Reject(fmt::format("iteration {}", message.iteration));
  if (message.num_components < 1 || message.num_components > kMaxComponents) {
    Reject(fmt::format("{} components", message.num_components));
  }
  const int64_t size = message.num_parameters, components = message.num_components;
  RequireSize("weights", components, message.weight.size(), components);
  RequireSize("means", message.num_means, message.mean.size(), components * size);
  RequireSize("covariances", message.num_covariances, message.covariance.size(),
              components * size * size);

  ParameterDistribution result;
  result.iteration = message.iteration;
  result.parameters = description.parameters;
  double total = 0;
  for (int64_t c = 0; c < components; ++c) {
    using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    const double weight = message.weight[static_cast<size_t>(c)];
    Gaussian component{
        Eigen::Map<const Eigen::VectorXd>(message.mean.data() + c * size, size),
        Eigen::Map<const RowMajor>(message.covariance.data() + c * size * size, size, size)};
    if (!(weight > 0) || !std::isfinite(weight) || !component.mean.allFinite() ||
        !component.covariance.allFinite()) {
      Reject(fmt::format("component {} is not finite or has no weight", c));
    }
    if (size > 0) RequireCovariance(component.covariance);
    total += weight;
    result.mixture.weights.push_back(weight);
    result.mixture.components.push_back(std::move(component));
  }
  if (std::abs(total - 1) > kRounding) Reject(fmt::format("weights sum to {}", total));
  RequirePlausible(result, description);
  try {
    result.residual = ReadResidual(message);
  } catch (const std::invalid_argument& error) {
    Reject(error.what());
  }
  result.explained = message.explained != 0;
  if (result.explained && result.residual) Reject("explained, and yet it has a residual");
  if (result.residual) {
    for (const Eigen::VectorXd& draw : result.residual->coordinates)
      RequireNearPrior(draw, "residual's draw", description);
  }
  const ConfigurationSpace space(description);
  const size_t state = static_cast<size_t>(description.num_positions()) +
                       static_cast<size_t>(description.num_velocities());
  if (message.start.size() % std::max<size_t>(1, state) != 0) Reject("start of the wrong size");
  for (size_t i = 0; state > 0 && i < message.start.size(); i += state) {
    result.starts.push_back(
        Eigen::VectorXf::Map(message.start.data() + i, static_cast<Eigen::Index>(state))
            .cast<double>());
    if (!std::ranges::all_of(result.starts.back(), IsPhysical))
      Reject(fmt::format("a start is beyond {:g}, or not finite", kGreatestQuantity));
    const std::string fault = space.Fault(result.starts.back().head(description.num_positions()));
    if (!fault.empty()) Reject("start: q " + fault);
  }
  return result;
}

parameter_distribution_t ParameterDistribution::ToMessage() const {
  parameter_distribution_t message;
  message.utime = 0;
  message.seed = 0;
  message.iteration = iteration;
  message.num_parameters = size();
  for (const ParameterDescription& parameter : parameters) {
    message.name.push_back(parameter.name);
    message.coordinate.push_back(ToCode(parameter.coordinate));
  }
  message.num_components = static_cast<int32_t>(mixture.components.size());
  message.weight = mixture.weights;
  for (const Gaussian& component : mixture.components) {
    for (Eigen::Index i = 0; i < component.mean.size(); ++i) {
      message.mean.push_back(component.mean[i]);
      for (Eigen::Index j = 0; j < component.mean.size(); ++j)
        message.covariance.push_back(component.covariance(i, j));
    }
  }
  message.num_means = static_cast<int32_t>(message.mean.size());
  message.num_covariances = static_cast<int32_t>(message.covariance.size());
  message.explained = explained ? 1 : 0;
  message.num_residuals = message.num_draws = 0;
  message.residual_margin = 0;
  if (residual) WriteResidual(*residual, &message);
  for (const Eigen::VectorXd& start : starts) {
    const Eigen::VectorXf rounded = start.cast<float>();
    message.start.insert(message.start.end(), rounded.begin(), rounded.end());
  }
  message.num_starts = static_cast<int32_t>(message.start.size());
  message.kl = message.ess = message.temperature = message.discrepancy = kNaN;
  return message;
}

}  // namespace plumb
