#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>

#include "calibrator/inference/prior.h"
#include "common/gaussian.h"

namespace plumb {

/// The returns R of relative-entropy policy search.
enum class RepsReturns {
  /// - cost mapped to [0, 1] among the samples, as the published implementations do: the
  ///   temperature is a pure number.
  kUnitRange,
  /// ln likelihood + ln prior - ln p_phi. At temperature 1 the weighted samples are the Bayesian
  /// posterior's, so the distribution comes to rest there and its width means something; a higher
  /// one is a step on the way.
  kLogLikelihood,
};

struct RepsOptions {
  RepsReturns returns = RepsReturns::kLogLikelihood;
  int samples = 25;  ///< of an update, >= 1
  /// bound of the weights' and of the distribution's divergence per update [nat]
  double kl = 0.1;
  double min_temperature = 1;  ///< in the units of R; 0.01 for costs in [0, 1]
  uint64_t seed = 1;
  uint32_t stream = 0x4e95;  ///< random numbers are keyed by (seed, stream, update, sample)
};

/// All that a search needs to go on to the same bits, beside its prior and its options.
struct RepsState {
  int update = 0;              ///< updates made
  Gaussian distribution = {};  ///< p_phi, in the prior's coordinates
  /// kLogLikelihood: all samples so far, n x M, and their ln likelihood + ln prior, M; -infinity
  /// for failures. Empty with other returns.
  Eigen::MatrixXd points = {};
  Eigen::VectorXd densities = {};
  double kl = 0;  ///< D_KL(new || old) of each update, summed [nat]
  /// of the last update; ess = effective number of its weighted samples
  double temperature = 0, ess = 0;
  int64_t failures = 0;  ///< samples whose cost or likelihood was not finite
};

/// Relative-entropy policy search: samples of p_phi are weighted by exp(R / temperature)
/// (SolveReps), a Gaussian is fitted to them and moved to as far as the KL bound allows (LimitKl).
/// Costs or log-likelihoods that are not finite are failures, infinitely bad; an update of failures
/// alone changes nothing.
///
/// With kLogLikelihood R is a quadratic of the coordinates, fitted by weighted least squares to all
/// samples so far that p_phi could have drawn (MORE: Abdolmaleki et al., NIPS 2015, section 3, with
/// samples reused), and the Gaussian that follows is exact; where the samples do not determine a
/// concave quadratic, the weighted samples have to do.
///
/// All samples of a search must be of one likelihood: with new data a new search begins. Not
/// thread-safe.
class RepsSearch {
 public:
  /// Begins at `state`, e.g. {0, prior}.
  RepsSearch(Gaussian prior, const RepsOptions& options, RepsState state);

  /// Parameters that the next update evaluates, n x options.samples.
  Eigen::MatrixXd Samples() const;
  /// @param values of Samples(): costs (kUnitRange) or log-likelihoods (kLogLikelihood).
  /// @return false if all of them are failures.
  bool Update(const Eigen::VectorXd& values);

  const RepsState& state() const { return state_; }

 private:
  void Remember(const Eigen::MatrixXd& samples, const Eigen::VectorXd& densities);

  Gaussian prior_;
  RepsOptions options_;
  RepsState state_;
};

/// The Gaussian that a search begins with: the prior's, or of a uniform one its central 68 %.
Gaussian CentralGaussian(const Prior& prior);

/// Some updates, from the prior on.
/// @param evaluate n x N parameters -> N costs or log-likelihoods, see RepsSearch::Update.
/// @param progress told how many updates have been made; may throw.
RepsState SearchByReps(
    const Prior& prior, const std::function<Eigen::VectorXd(const Eigen::MatrixXd&)>& evaluate,
    const RepsOptions& options, int updates, const std::function<void(int)>& progress = [](int) {});

}  // namespace plumb
