#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "calibrator/discrepancy.h"
#include "calibrator/inference/reps.h"

namespace plumb {

/// Something the motion determines: a combination sum_i power_i * coordinate_i of the parameters' coordinates, which
/// for logarithmic coordinates is a product of powers.
struct Combination {
  std::string name;       ///< "gravity / length", "mass length^2"
  Eigen::VectorXd power;  ///< one per parameter, small integers where the data allow
  double mean;  ///< exp(power . mean) for logarithmic coordinates, physical for a parameter on its own, else power . mean
  double sd;              ///< of the same, to first order
};

/// What a set of transitions can and cannot tell about the parameters.
struct Identifiability {
  Eigen::MatrixXd information;            ///< Fisher information of the coordinates, n x n
  std::vector<Combination> combinations;  ///< as many as the information has rank
  std::vector<Eigen::VectorXd> null;      ///< directions in the coordinates that change nothing; largest entry 1
  std::string words;                      ///< for people
};

/// From the Jacobian of the whitened one-step errors at `distribution.mean` (central differences). A direction
/// counts as null if the information along it, in units of the prior, is below 1e-6 of the largest.
Identifiability FindIdentifiability(const RobotDescription& robot, Discrepancy& discrepancy,
                                    std::span<const Rollout> rollouts, const Gaussian& distribution);

/// The same from the information that data have about the coordinates, n x n. @param prior_sd of the coordinates.
Identifiability FindIdentifiability(const RobotDescription& robot, const Eigen::MatrixXd& information,
                                    const Eigen::VectorXd& prior_sd, const Gaussian& distribution);

}  // namespace plumb
