#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>

namespace plumb {

/// Distance of a set of simulated vectors (columns) from a recorded one, which may be of another
/// size. Immutable, hence thread-safe. Infinite if the simulated set is empty or has an entry that
/// is not finite.
using SetDistance = std::function<double(const Eigen::MatrixXd& simulated)>;

/// Between the distributions of two sets of columns, of any sizes > 0, as they are (not whitened):
/// 2 E|X - Y| - E|X - X'| - E|Y - Y'| over all pairs (V-statistic: never negative, 0 for equal
/// sets; Szekely & Rizzo, J. Stat. Planning and Inference 143, 2013, eq. 6.1).
double EnergyDistance(const Eigen::MatrixXd& x, const Eigen::MatrixXd& y);

/// Squared maximum mean discrepancy, unbiased, hence negative now and then: mean k(x, x') + mean
/// k(y, y') - 2 mean k(x, y), x' != x (Gretton et al., JMLR 13, 2012, eq. 3). k is the mean of
/// exp(-d^2 / 2 h^2) over the bandwidths h = scale * {1/4, 1/2, 1, 2, 4}. Sets of one column have
/// no x': that term is k(x, x) = 1.
double MaximumMeanDiscrepancy(const Eigen::MatrixXd& x, const Eigen::MatrixXd& y, double scale);

/// Squared 2-Wasserstein distance of the projections onto the unit columns of `directions`,
/// averaged: the exact integral over the two quantile functions' difference squared (Bonneel et
/// al., J. Math. Imaging and Vision 51, 2015).
double SlicedWasserstein(const Eigen::MatrixXd& x, const Eigen::MatrixXd& y,
                         const Eigen::MatrixXd& directions);

/// "energy", "mmd" or "sliced-wasserstein" from the recorded set (columns; at least one). Both sets
/// are whitened by the recorded one's mean and covariance; the bandwidth is its median distance,
/// and the 64 directions are fixed by `seed`, so that sets compared with the same recorded one are
/// compared with each other fairly.
/// @throws std::invalid_argument for another name, naming the choices, or a recorded set that is
/// empty or not finite.
SetDistance MakeDistance(const std::string& name, const Eigen::MatrixXd& recorded,
                         uint64_t seed = 1);

/// Distances of outcomes (columns) from the observed one. Entries of `observed` that are NaN and
/// statistics of no scale are not compared; an outcome with an entry that is not finite is
/// infinitely far. Divided by the scale, they are: "squared" the sum of squares, "absolute" the sum
/// of absolute values, "mahalanobis" the root of the sum of squares, i.e. Mahalanobis' distance for
/// independent noise of that scale.
/// @throws std::invalid_argument for another name, naming the choices.
Eigen::VectorXd Distances(const std::string& name, const Eigen::MatrixXd& outcomes,
                          const Eigen::VectorXd& observed, const Eigen::VectorXd& scale);

/// kSdOverMedianDeviation * median absolute deviation from the median, a standard deviation for
/// normal noise, of every row over the columns that are finite throughout; 0 where it does not vary
/// or there are none.
Eigen::VectorXd MedianDeviation(const Eigen::MatrixXd& outcomes);

/// Scale of every statistic that outliers in the observation do not dominate (PCMAD: Schaelte,
/// Alamoudi & Hasenauer, "Robust adaptive distance functions for approximate Bayesian inference on
/// outlier-corrupted data", 2021): the median deviation plus the distance of the median from what
/// was observed; without the latter if more than a third of the statistics lie over two deviations
/// off, for then the simulations, not the observation, are amiss.
Eigen::VectorXd RobustScale(const Eigen::MatrixXd& outcomes, const Eigen::VectorXd& observed);

}  // namespace plumb
