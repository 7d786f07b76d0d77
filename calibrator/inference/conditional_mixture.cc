#include "calibrator/inference/conditional_mixture.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <stdexcept>

#include "calibrator/inference/gaussian_mixture.h"
#include "calibrator/inference/truncated_prior.h"
#include "common/decompositions.h"
#include "common/median.h"
#include "common/special_numbers.h"

namespace plumb {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

// First stream words.
constexpr uint32_t kParameters = 1, kEstimate = 2, kFinal = 3, kSamples = 4;
// Simulations of less than this of the nearest one's weight are left out.
constexpr double kNegligible = 1e-3;
// More would cost time and hardly change a mixture.
constexpr Index kMaxOutcomes = 20'000;

// Simulations that succeeded with parameters in the region.
struct Simulations {
  MatrixXd joint;    // (n + m) x N: standard parameters above outcomes
  VectorXd squared;  // N: Mahalanobis distances from what was observed, squared
};

double EffectiveNumber(const VectorXd& w) { return w.sum() * w.sum() / w.squaredNorm(); }

// Covariance of the outcomes (rows x N), of which a few may be absurd: they are pulled in to 5
// scaled median deviations from the median before.
MatrixXd RobustCovariance(MatrixXd outcomes) {
  const Index count = outcomes.cols();
  for (auto row : outcomes.rowwise()) {
    VectorXd sorted = row;
    const auto median = [&sorted] {
      std::nth_element(sorted.begin(), sorted.begin() + sorted.size() / 2, sorted.end());
      return sorted(sorted.size() / 2);
    };
    const double centre = median();
    sorted = (row.array() - centre).abs();
    const double reach = 5 * kSdOverMedianDeviation * median();
    // Where more than half are equal there is no telling what is absurd.
    if (reach > 0) row = row.array().max(centre - reach).min(centre + reach).eval();
  }
  outcomes.colwise() -= outcomes.rowwise().mean().eval();
  MatrixXd covariance = outcomes * outcomes.transpose() / static_cast<double>(count);
  covariance.diagonal().array() +=
      1e-9 * covariance.diagonal().maxCoeff() + std::numeric_limits<double>::min();
  return covariance;
}

// Gaussian kernel of the width that gives an effective number of `target`, or equal weights if that
// cannot be.
VectorXd GaussianKernelWeights(const VectorXd& squared, double target) {
  if (target >= static_cast<double>(squared.size())) return VectorXd::Ones(squared.size());
  const double nearest = squared.minCoeff();
  const auto weights = [&](double width) -> VectorXd {
    return ((squared.array() - nearest) / (-2 * width * width)).max(-700).exp();
  };
  double narrow = std::log(1e-6), wide = std::log(1e6);
  for (int i = 0; i < 50; ++i) {
    const double middle = (narrow + wide) / 2;
    (EffectiveNumber(weights(std::exp(middle))) > target ? wide : narrow) = middle;
  }
  return weights(std::exp(wide));
}

// Columns of some weight; of too many, the heaviest.
std::vector<Index> Weighty(const VectorXd& weights) {
  std::vector<Index> columns;
  for (Index j = 0; j < weights.size(); ++j) {
    if (weights(j) > kNegligible * weights.maxCoeff()) columns.push_back(j);
  }
  if (static_cast<Index>(columns.size()) > kMaxOutcomes) {
    std::stable_sort(columns.begin(), columns.end(),
                     [&](Index a, Index b) { return weights(a) > weights(b); });
    columns.resize(kMaxOutcomes);
  }
  return columns;
}

// Linear pool, in equal parts, of the estimates that are hardly worse than the best: their errors
// differ, and the scores cannot tell them apart.
GaussianMixture Pool(const std::vector<GaussianMixture>& estimates,
                     const std::vector<double>& scores) {
  constexpr double kHardlyWorse = 0.06;  // nat
  const double best = *std::max_element(scores.begin(), scores.end());
  const auto good = [&](size_t i) { return scores[i] >= best - kHardlyWorse; };
  double count = 0;
  for (size_t i = 0; i < scores.size(); ++i) count += good(i);
  GaussianMixture pool;
  for (size_t i = 0; i < estimates.size(); ++i) {
    if (!good(i)) continue;
    for (const double w : estimates[i].weights) pool.weights.push_back(w / count);
    pool.components.insert(pool.components.end(), estimates[i].components.begin(),
                           estimates[i].components.end());
  }
  return pool;
}

class Inference {
 public:
  Inference(const Problem& problem, const ConditionalMixtureOptions& options, uint64_t seed)
      : problem_(problem), options_(options), seed_(seed), n_(problem.prior.size()) {
    for (Index i = 0; i < problem.observed.size(); ++i) {
      if (!std::isnan(problem.observed(i))) compared_.push_back(i);
    }
    if (compared_.empty() || options.simulations < 1 || options.rounds < 1 ||
        options.max_components < 1 || options.samples < 1 ||
        !(options.local_share > 0 && options.local_share <= 1)) {
      throw std::invalid_argument(
          "nothing was observed, or a budget, round, component or sample is less than one");
    }
    m_ = static_cast<Index>(compared_.size());
    observed_ = problem.observed(compared_);
    parameters_.resize(n_, options.simulations);
    outcomes_.resize(m_, options.simulations);
  }

  // Draws parameters from the region and simulates them, until `until` simulations have been made.
  void Simulate(int round, Index until) {
    Random random(seed_, {kParameters, static_cast<uint32_t>(round)});
    const Index more = until - made_;
    if (region_) {
      const auto draws = region_->Sample(more, random);
      if (!draws)
        region_.reset();  // too small to be found: back to the whole prior
      else
        parameters_.middleCols(made_, more) = *draws;
    }
    if (!region_) parameters_.middleCols(made_, more) = StandardNormals(n_, more, random);
    const MatrixXd outcomes =
        problem_.simulate(problem_.prior.FromStandard(parameters_.middleCols(made_, more)), made_);
    for (Index j = 0; j < more; ++j) {
      const bool failed = !outcomes.col(j).allFinite();
      failures_ += failed;
      outcomes_.col(made_ + j) = outcomes.col(j)(compared_);
      if (failed) outcomes_(0, made_ + j) = kNaN;
    }
    made_ = until;
  }

  Simulations Inside() const {
    std::vector<Index> columns;
    for (Index j = 0; j < made_; ++j) {
      if (outcomes_.col(j).allFinite() && (!region_ || region_->Contains(parameters_.col(j))))
        columns.push_back(j);
    }
    Simulations inside{MatrixXd(n_ + m_, static_cast<Index>(columns.size())), {}};
    inside.joint << parameters_(Eigen::all, columns), outcomes_(Eigen::all, columns);
    if (columns.empty()) return inside;
    const Eigen::LLT<MatrixXd> factor(RobustCovariance(inside.joint.bottomRows(m_)));
    const MatrixXd offset = inside.joint.bottomRows(m_).colwise() - observed_;
    inside.squared = factor.matrixL().solve(offset).colwise().squaredNorm();
    return inside;
  }

  // The smallest number of simulations anything is learned from.
  double Fewest() const { return 10 * static_cast<double>(n_ + m_); }
  double Effective(const Simulations& inside, double share) const {
    return std::max(share * static_cast<double>(inside.joint.cols()), std::max(200., 2 * Fewest()));
  }

  // Truncates the prior to the neighbourhood of what was observed.
  ConditionalMixtureDiagnostics::Round Truncate(int round) {
    const Simulations inside = Inside();
    ConditionalMixtureDiagnostics::Round report{made_, inside.joint.cols(), 0, 0,
                                                region_.has_value()};
    if (static_cast<double>(inside.joint.cols()) < Fewest()) return report;
    const VectorXd weights =
        GaussianKernelWeights(inside.squared, Effective(inside, options_.local_share));
    report.effective = EffectiveNumber(weights);
    const std::vector<Index> columns = Weighty(weights);
    Random random(seed_, {kEstimate, static_cast<uint32_t>(round)});
    MixtureOptions rough;
    rough.tolerance = 1e-3;
    const MixtureFit fit = SelectMixture(inside.joint(Eigen::all, columns), weights(columns),
                                         options_.max_components, random, rough);
    report.components = static_cast<int>(fit.mixture.components.size());
    std::vector<Index> parameters(static_cast<size_t>(n_));
    std::iota(parameters.begin(), parameters.end(), 0);
    region_.emplace(Marginal(fit.mixture, parameters), options_.truncation);
    report.truncated = true;
    return report;
  }

  // p(standard parameters | observed) by the kernels' widths that predict simulations left out
  // best.
  GaussianMixture Estimate(ConditionalMixtureDiagnostics& diagnostics) const {
    constexpr int kFolds = 3;
    const Simulations inside = Inside();
    if (static_cast<double>(inside.joint.cols()) < Fewest()) {
      return {{1}, {{VectorXd::Zero(n_), MatrixXd::Identity(n_, n_)}}};
    }
    const std::vector<double> shares = {1, 0.5, 0.25, 0.125, 0.0625};
    // Simulations that judge have weight in all kernels, or widths would be judged by different
    // ones.
    VectorXd judged = GaussianKernelWeights(inside.squared, Effective(inside, shares.back()));
    judged = (judged.array() > kNegligible * judged.maxCoeff()).select(judged, 0).eval();
    std::vector<GaussianMixture> estimates;
    double last_effective = 0;
    for (size_t i = 0; i < shares.size(); ++i) {
      const VectorXd weights = GaussianKernelWeights(inside.squared, Effective(inside, shares[i]));
      const double effective = EffectiveNumber(weights);
      if (effective == last_effective) break;  // no more can be left out
      last_effective = effective;
      const std::vector<Index> columns = Weighty(weights);
      const MatrixXd samples = inside.joint(Eigen::all, columns);
      const VectorXd w = weights(columns), score_weights = judged(columns);
      Random random(seed_, {kFinal, static_cast<uint32_t>(i)});
      MixtureOptions fine;
      fine.tolerance = 1e-4;
      const MixtureFit fit = SelectMixture(samples, w, options_.max_components, random, fine);
      double score = 0;
      for (int fold = 0; fold < kFolds; ++fold) {
        score +=
            HeldOutScore(samples, w, score_weights, static_cast<int>(fit.mixture.components.size()),
                         fold, kFolds, random, fine);
      }
      diagnostics.held_out.push_back(score / score_weights.sum());
      estimates.push_back(Condition(fit.mixture, observed_));
    }
    return Pool(estimates, diagnostics.held_out);
  }

  Posterior Result(const GaussianMixture& standard) const {
    Random random(seed_, {kSamples});
    Posterior posterior;
    posterior.samples = problem_.prior.FromStandard(Sample(standard, options_.samples, random));
    const Index some = std::min<Index>(posterior.samples.cols(), 2'000);
    posterior.mixture =
        SelectMixture(posterior.samples.leftCols(some), VectorXd::Ones(some), 16, random).mixture;
    posterior.simulations = made_;
    posterior.failures = failures_;
    return posterior;
  }

 private:
  // Sum over the simulations of one fold of ln p(parameters | outcome) by a mixture fitted to the
  // others.
  double HeldOutScore(const MatrixXd& samples, const VectorXd& weights,
                      const VectorXd& score_weights, int components, int fold, int folds,
                      Random& random, const MixtureOptions& options) const {
    std::vector<Index> train, test;
    for (Index j = 0; j < samples.cols(); ++j) (j % folds == fold ? test : train).push_back(j);
    const MatrixXd left_out = samples(Eigen::all, test);
    const GaussianMixture joint =
        FitMixture(samples(Eigen::all, train), weights(train), components, random, options).mixture;
    std::vector<Index> outcome(static_cast<size_t>(m_));
    std::iota(outcome.begin(), outcome.end(), n_);
    const VectorXd logs = LogDensities(joint, left_out) -
                          LogDensities(Marginal(joint, outcome), left_out.bottomRows(m_));
    return score_weights(test).dot(logs);
  }

  const Problem& problem_;
  const ConditionalMixtureOptions& options_;
  const uint64_t seed_;
  const Index n_;                // parameters
  Index m_;                      // outcomes that were observed
  std::vector<Index> compared_;  // which
  VectorXd observed_;
  MatrixXd parameters_, outcomes_;
  Index made_ = 0;
  int64_t failures_ = 0;
  std::optional<TruncatedPrior> region_;  // none: the whole prior
};

}  // namespace

Posterior InferConditionalMixture(const Problem& problem, const ConditionalMixtureOptions& options,
                                  uint64_t seed, ConditionalMixtureDiagnostics* diagnostics) {
  Inference inference(problem, options, seed);
  ConditionalMixtureDiagnostics unwanted;
  ConditionalMixtureDiagnostics& report = diagnostics ? *diagnostics : unwanted;
  report = {};
  const int rounds = static_cast<int>(std::min<int64_t>(options.rounds, options.simulations));
  for (int round = 0; round < rounds; ++round) {
    inference.Simulate(round, options.simulations * (round + 1) / rounds);
    if (round + 1 < rounds) report.rounds.push_back(inference.Truncate(round));
  }
  return inference.Result(inference.Estimate(report));
}

}  // namespace plumb
