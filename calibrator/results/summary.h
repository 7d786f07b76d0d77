#pragma once

#include <Eigen/Core>
#include <string>

#include "calibrator/results/findings.h"
#include "robot/description.h"

namespace plumb {

/// Findings in the numbers that people want, n parameters, physical units unless said otherwise.
/// All that is written about a calibration takes its numbers from here.
struct Summary {
  Eigen::VectorXd prior_mean, prior_sd;  ///< moments, exact
  Eigen::VectorXd mean, sd;              ///< of the samples
  Eigen::VectorXd lower, upper;          ///< 2.5 % and 97.5 % quantiles of the samples
  Eigen::MatrixXd covariance;            ///< n x n, of the samples
  Gaussian coordinates;                  ///< moments of the mixture, coordinates
  Eigen::VectorXd
      /// [nat] ln(prior sd / posterior sd) of each coordinate: information gained, if both are
      /// normal
      gain;
  Eigen::MatrixXd
      /// n x N: the findings', or 4000 drawn from the mixture where they have fewer than two
      samples;
};

/// @throws std::invalid_argument saying what is wrong if prior, posterior or samples do not fit the
/// robot, are not finite, or a covariance is not positive definite: such findings must not be
/// written as if they were some. Thread-safe.
Summary Summarise(const Findings& findings, const RobotDescription& robot);

/// Whether findings are to be relied on, as plumb calibrate --strict asks: better than the prior on
/// motion not seen, no alarm, the logs agree, efforts stand in their rows, and there is no
/// Contradiction. Thread-safe.
bool Trustworthy(const Findings& findings);

/// How far the posterior's mean is from the prior's, in the prior's standard deviations of each
/// coordinate. Thread-safe.
Eigen::VectorXd DistancesFromPrior(const Findings& findings);
/// Says which parameters are more than kContradiction standard deviations from the prior's mean:
/// what fits a log no matter how absurd it is, as where its efforts have the wrong sign, is absurd
/// itself. Empty if none is. Thread-safe.
std::string Contradiction(const Findings& findings, const RobotDescription& robot);
/// One prior of 16 000 that is right is so far from the truth.
inline constexpr double kContradiction = 4;

}  // namespace plumb
