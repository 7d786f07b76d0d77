#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "calibrator/inference/prior.h"
#include "common/random.h"

namespace plumb {

// The functions here share nothing: thread-safe if the given function is, which the caller's thread
// calls.

/// Something about the parameters of which a posterior is judged: one of them, a combination that
/// the data tell or one that they do not.
struct SbcQuantity {
  std::string name;
  std::function<double(const Eigen::VectorXd& parameters)> of;  ///< in the prior's coordinates
};

/// The parameters themselves, in the prior's order.
std::vector<SbcQuantity> Marginals(const std::vector<std::string>& names);

/// One run of the inference to be judged: simulates data of a robot with parameters `truth` and
/// infers a posterior from them.
/// @param random of this run, for the data's noise and whatever else is drawn.
/// @return n x M independent draws of the posterior, in the prior's coordinates (draws of a Markov
/// chain must be thinned until they are), M the same in all runs; none if the inference failed. A
/// draw that is not finite makes it a failure, too.
using SbcFit =
    std::function<std::optional<Eigen::MatrixXd>(const Eigen::VectorXd& truth, Random& random)>;

/// How uniform the ranks of one quantity are over the runs that did not fail; NaN if all did.
struct SbcUniformity {
  static constexpr std::array<double, 3> kLevels{0.5, 0.8, 0.95};

  std::string name;
  /// Of so uneven a histogram of ranks (Pearson's chi-squared test, up to 20 bins), if they were
  /// uniform.
  double chi2_p;
  /// Of so far an excursion of the ranks' distribution function from a uniform one's, wherever that
  /// is least probable: the simultaneous test of Saeilynoja, Buerkner and Vehtari (Statistics and
  /// Computing 32:32, 2022), exact for discrete ranks.
  double ecdf_p;
  /// Share of the runs in which the posterior's central interval of each level holds the truth.
  /// Uniform ranks give the level.
  std::array<double, 3> coverage;
  /// of (rank + 1/2) / (M + 1); 1/2 and 1/12 (1 - 1 / (M + 1)^2) if uniform
  double mean, variance;
};

/// The ranks that simulation-based calibration has found, and their tests.
struct SbcResult {
  static constexpr int kFailed = -1;

  int runs = 0;
  int draws = 0;  ///< M of each posterior; 0 if all runs failed
  /// runs x quantities: how many draws are below the truth, 0 to M; kFailed in a run that failed.
  Eigen::MatrixXi ranks;
  std::vector<SbcUniformity> quantities;
  /// Runs without a posterior. Tests and coverage are of the others, and hold for all only if
  /// failures are few: nobody knows whether the posterior would have been right where there is
  /// none.
  int failures = 0;
};

/// Simulation-based calibration (Talts, Betancourt, Simpson, Vehtari and Gelman, arXiv:1804.06788):
/// over truths drawn from the prior and data simulated with them, a right posterior's draws rank
/// the truth uniformly, whatever is asked of them. Draws equal to the truth count as below it or
/// not at random. Runs are made one after the other; run i draws from a generator named by (seed,
/// i), so that any of them can be repeated alone.
/// @throws std::invalid_argument if there is no run or no quantity, one is NaN, or posteriors have
/// other sizes than they should; and what `fit` throws.
SbcResult RunSbc(const Prior& prior, const SbcFit& fit, const std::vector<SbcQuantity>& quantities,
                 int runs, uint64_t seed);

/// The p-values of SbcUniformity, of at least one rank, each 0 to `draws`. 1 if there are too few
/// ranks to tell.
double UniformityByChi2(const std::vector<int>& ranks, int draws);
double UniformityByEcdf(const std::vector<int>& ranks, int draws);

/// How many posteriors it takes at least: with fewer, the tests do not find out ones that are as
/// wrong as can be, that is, whose truths are all on one side of them, all outside them, or all in
/// their very middle. 14 for ten tests of 99 draws; 100 at most.
/// @param draws of each posterior, 2 at least. @param tests that are made of them.
int FewestPosteriors(int draws, size_t tests);

inline constexpr char kSbcCalibrated[] = "calibrated", kSbcUnknown[] = "unknown";
/// Of each quantity: in what way the posterior is wrong, if its tests say so at the 1 % level,
/// corrected for their number ("too sure", "too low", ...), else kSbcCalibrated, or kSbcUnknown
/// where there are fewer than FewestPosteriors.
std::vector<std::string> SbcVerdicts(const SbcResult& result);

/// A table for the terminal, a line for each quantity: p-values, coverage and verdict.
std::string SbcSummary(const SbcResult& result);

}  // namespace plumb
