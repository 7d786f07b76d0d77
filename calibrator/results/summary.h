#pragma once

#include <Eigen/Core>

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
/// motion not seen, no alarm, and the logs agree. Thread-safe.
bool Trustworthy(const Findings& findings);

/// Quantile of sorted values, linear between them (type 7 of Hyndman and Fan, The American
/// Statistician 50, 1996).
/// @param share 0 to 1. @return NaN of no values.
double Quantile(const std::vector<double>& sorted, double share);

}  // namespace plumb
