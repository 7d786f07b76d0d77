#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "calibrator/fit/discrepancy.h"
#include "calibrator/inference/reps.h"

namespace plumb {

/// Something the motion determines: a combination sum_i power_i * coordinate_i of the parameters'
/// coordinates, which for logarithmic coordinates is a product of powers.
struct Combination {
  std::string name;       ///< "gravity / length", "mass length^2"
  Eigen::VectorXd power;  ///< one per parameter, small integers where the data allow
  /// exp(power . mean) for logarithmic coordinates, physical for a parameter on its own, else power
  /// . mean
  double mean;
  double sd;  ///< of the same, to first order
};

/// A direction in the coordinates about which the data say less than the prior did.
struct WeakDirection {
  Eigen::VectorXd direction;  ///< largest entry 1; of a parameter on its own, a unit vector
  double sd_ratio;            ///< posterior sd along it over the prior's, 0.7 to 1
};

/// The combinations of parameters that a set of transitions determines, and those it does not.
struct Identifiability {
  Eigen::MatrixXd information;            ///< Fisher information of the coordinates, n x n
  std::vector<Combination> combinations;  ///< as many as the information has rank
  /// Directions in the coordinates that change nothing: a basis with as few entries as can be
  /// found, small integers where they do, else with 1 as first entry. One with a single entry is a
  /// parameter without effect.
  std::vector<Eigen::VectorXd> null;
  std::vector<WeakDirection> weak;  ///< that change something, but less than the prior's sd by 30 %
  /// n: standard deviation of each coordinate if nothing but the data told, from the information's
  /// inverse where it has one (Cramer-Rao); infinite for a parameter that a null direction
  /// involves.
  Eigen::VectorXd cramer_rao;
  std::string summary;  ///< for people
};

/// The information along a direction, in units of the prior, up to which it counts as null: 1e-6 of
/// the largest, but 0.01 at most, which is less than the prior's by so much that it does not change
/// the sd.
double NullInformation(double largest);

/// From the Fisher information of the coordinates.
/// @param information n x n; if it is not finite nothing is said to be known. @param prior_sd n, of
/// the coordinates.
/// @param distribution of the coordinates: what is known of the combinations. Thread-safe.
Identifiability FindIdentifiability(const RobotDescription& robot,
                                    const Eigen::MatrixXd& information,
                                    const Eigen::VectorXd& prior_sd, const Gaussian& distribution);

/// Fisher information of the coordinates, n x n, of the transitions' whitened one-step errors, by
/// central differences; where one end is no simulator, as beyond friction 0, by the other one
/// alone. Not finite where the simulation fails at both, or in the middle.
/// @param h n, the differences.
Eigen::MatrixXd StepInformation(const RobotDescription& robot, Discrepancy& discrepancy,
                                std::span<const Rollout> rollouts,
                                const Eigen::VectorXd& coordinates, const Eigen::VectorXd& h);

/// FindIdentifiability with the information of single steps at `distribution.mean`.
Identifiability FindIdentifiability(const RobotDescription& robot, Discrepancy& discrepancy,
                                    std::span<const Rollout> rollouts,
                                    const Gaussian& distribution);

}  // namespace plumb
