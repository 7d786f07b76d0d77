#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "common/gaussian.h"
#include "common/random.h"
#include "plumb/parameter_distribution_t.hpp"
#include "robot/description.h"

namespace plumb {

/// The description's prior over the P coordinates: independent, in the order of
/// RobotDescription::parameters. Thread-safe.
Gaussian PriorGaussian(const RobotDescription& description);

/// Which simulators could have produced a robot's motion: a mixture of Gaussians over the
/// *coordinates* of the uncertain parameters (see ParameterDescription::coordinate), in the order
/// of RobotDescription::parameters. Immutable use is thread-safe.
struct ParameterDistribution {
  int iteration = 0;                             ///< of SimOpt; 0 = the prior
  std::vector<ParameterDescription> parameters;  ///< P
  /// of P coordinates; covariances may be singular: of a parameter that is known exactly, or
  /// exactly tied to another
  GaussianMixture mixture;

  /// The description's prior: one component with a diagonal covariance.
  static ParameterDistribution Prior(const RobotDescription& description);

  /// A message's distribution. @throws std::invalid_argument saying what is wrong: names or
  /// coordinates that are not the description's, counts that do not fit, numbers that are not
  /// finite, weights that do not sum to 1, a covariance that is not symmetric and positive
  /// semidefinite.
  static ParameterDistribution FromMessage(const parameter_distribution_t& message,
                                           const RobotDescription& description);
  /// The message, except for utime, seed (0) and diagnostics (NaN), which are the sender's to fill
  /// in.
  parameter_distribution_t ToMessage() const;

  int size() const { return static_cast<int>(parameters.size()); }
  /// Draws a simulator. @return P values in physical units.
  Eigen::VectorXd Sample(Random& random) const;
  /// Draws a simulator. @return P values in coordinates.
  Eigen::VectorXd SampleCoordinates(Random& random) const;
  Eigen::VectorXd ToPhysical(const Eigen::VectorXd& coordinates) const;

  /// Mean and standard deviation of the mixture, P values in physical units; for a logarithmic
  /// coordinate those of the log-normal: mean e^(m + s^2/2), variance (e^(s^2) - 1) e^(2m + s^2).
  Eigen::VectorXd Mean() const;
  Eigen::VectorXd Sd() const;
};

}  // namespace plumb
