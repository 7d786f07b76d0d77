#pragma once

#include <Eigen/Core>
#include <vector>

namespace plumb {

/// Weights of N simulators as a population.
struct PopulationWeights {
  Eigen::VectorXd weights;  ///< N, >= 0, sum to 1; 0 for simulators that failed
  /// mean energy score of the weighted predictions, in the units of the outcomes
  double score;
  /// the score is at most this above the smallest possible (Frank & Wolfe's certificate)
  double gap;
  int failed;  ///< simulators with a prediction that is not finite
};

/// What one robot does may be what several simulators do in turn: a payload sometimes on the left
/// and sometimes on the right makes its next state bimodal. No single parameter explains that, and
/// least squares picks one between the modes, which explains nothing. The mixture of simulators
/// that does minimises the mean over transitions t of the energy score (Gneiting & Raftery, J.
/// American Statistical Association 102, 2007, eq. 21), a proper scoring rule:
///   E|X - y_t| - E|X - X'| / 2 = a'w - w'K w / 2,   a_n = mean_t |x_tn - y_t|,
///   K_nm = mean_t |x_tn - x_tm|.
/// On the simplex it is convex, for |.| is conditionally negative definite. It is solved by moving
/// weight between the pair of simulators with the steepest ascent and descent, by an exact line
/// search (pairwise steps: Lacoste-Julien & Jaggi, NeurIPS 2015), until the gap is below
/// `tolerance` times the mean of K. Deterministic; among equal simulators the first gets the
/// weight.
///
/// @param predictions per transition, a column per simulator (d x N). @param outcomes a column per
/// transition (d x T), finite. Coordinates should be whitened by the measurement's noise or their
/// spread: |.| is Euclid's.
/// @throws std::invalid_argument for no transitions, sizes that do not match, outcomes not finite,
/// or all failed.
PopulationWeights FitPopulation(const std::vector<Eigen::MatrixXd>& predictions,
                                const Eigen::MatrixXd& outcomes, double tolerance = 1e-6);

}  // namespace plumb
