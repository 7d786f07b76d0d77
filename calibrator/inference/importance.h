#pragma once

#include <Eigen/Core>
#include <functional>

#include "common/gaussian.h"

namespace plumb {

// The functions here share nothing: thread-safe if the given function is, which the caller's thread
// calls.

struct ImportanceOptions {
  int samples = 400;  ///< a round
  int rounds = 4;     ///< twice as many where the density is rough
  uint64_t seed = 1;
  Eigen::MatrixXd widest = {};  ///< n x n; see below. Empty: no bound
};

struct ImportanceFit {
  GaussianMixture mixture;  ///< adapted to the target
  Eigen::MatrixXd samples;  ///< n x N of all rounds, newest last
  Eigen::VectorXd weights;  ///< of the samples, sum to 1
  double ess = 0;           ///< effective number of samples, 1 / sum w^2, before any power
  double heaviest = 0;      ///< largest weight, likewise
  double power = 1;         ///< to which the weights were raised in the end: 1 = as they are
};

/// A density known up to its constant, from guesses of its modes: population Monte Carlo with a
/// mixture of Gaussians as proposal (Cappe et al., Statistics and Computing 18, 2008, eq. 11-13),
/// its samples weighted by the deterministic mixture of all rounds' proposals (Cornuet et al.,
/// Scand. J. Stat. 39, 2012: AMIS). The proposals have four times the components' variance for half
/// of the draws, so that tails are seen, too; the first trusts the guess's weights by half only. A
/// component with fewer than n + 1 effective samples keeps its covariance.
/// Where fewer than kLeastEss (n + 1) samples count, weights are raised to the power, below one,
/// that makes so many count (Koblents and Miguez, Statistics and Computing 25, 2015): proposals
/// then find their way, rather than one sample. If that is so after all rounds, the density has
/// more peaks than samples can tell apart: up to as many rounds more are made, with proposals of
/// 100 times the variance for half of the draws, yet in no direction wider than `widest`, and no
/// component becomes narrower. What comes of it lies between proposals and target: wide rather than
/// sure of a peak that a sample has met, and, if `widest` is the prior's covariance, no wider than
/// one who has seen nothing.
/// Everything that is not finite has density zero.
/// @param log_density of n x N points.
/// @throws std::invalid_argument if no sample has any density.
ImportanceFit FitByImportance(
    const std::function<Eigen::VectorXd(const Eigen::MatrixXd&)>& log_density,
    const GaussianMixture& guess, const ImportanceOptions& options = {});

/// Effective samples for each parameter, and as many, with which a round's weights are as they are.
inline constexpr double kLeastEss = 5;

/// n x count points drawn from weighted ones, systematically: each as often as its weight says, up
/// to one.
Eigen::MatrixXd Resample(const Eigen::MatrixXd& samples, const Eigen::VectorXd& weights,
                         Eigen::Index count, Random& random);

}  // namespace plumb
