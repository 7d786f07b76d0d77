#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "common/random.h"
#include "plumb/parameter_distribution_t.hpp"
#include "robot/description.h"

namespace plumb {

/// Which simulators could have produced a robot's motion: a mixture of Gaussians over the
/// *coordinates* of the uncertain parameters (the logarithm of a positive one, else itself), in the
/// order of RobotDescription::parameters. Immutable use is thread-safe.
struct ParameterDistribution {
  struct Component {
    double weight;               ///< > 0; they sum to 1
    Eigen::VectorXd mean;        ///< P, in coordinates
    Eigen::MatrixXd covariance;  ///< P x P, symmetric, positive semidefinite, in coordinates

    bool operator==(const Component&) const = default;
  };

  int iteration = 0;  ///< of SimOpt; 0 = the prior
  std::vector<ParameterDescription> parameters;
  std::vector<Component> components;

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
