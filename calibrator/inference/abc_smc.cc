#include "calibrator/inference/abc_smc.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "calibrator/inference/abc_posterior.h"
#include "calibrator/inference/distances.h"
#include "calibrator/inference/gaussian_mixture.h"
#include "calibrator/inference/kernel_density.h"
#include "calibrator/inference/regression_adjustment.h"

namespace plumb {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

constexpr uint32_t kSmcProposals = 1, kSmcPosteriorStream = 2;  // first stream words

struct Population {
  MatrixXd u, outcomes;
  VectorXd weights;  // sum to 1
};

// All simulations of a generation, and which of them were accepted.
struct Generation {
  Generation(Index num_parameters, Index num_outcomes)
      : u(num_parameters, 0), outcomes(num_outcomes, 0) {}

  void Add(const MatrixXd& more_u, const MatrixXd& more_outcomes) {
    u.conservativeResize(Eigen::NoChange, u.cols() + more_u.cols());
    outcomes.conservativeResize(Eigen::NoChange, u.cols());
    u.rightCols(more_u.cols()) = more_u;
    outcomes.rightCols(more_u.cols()) = more_outcomes;
  }
  double acceptance() const {
    return static_cast<double>(accepted.size()) / static_cast<double>(u.cols());
  }

  MatrixXd u, outcomes;
  std::vector<Index> accepted;
};

// Covariance of each member's kernel: of the nearest quarter of the population, as there may be
// several modes.
GaussianMixture Kernels(const Population& population) {
  const Index count = population.u.cols(), n = population.u.rows();
  const VectorXd& w = population.weights;
  const double h = Bandwidth(1 / w.squaredNorm(), n);
  const auto spread = [&](const std::vector<Index>& members, const VectorXd& about) -> MatrixXd {
    const VectorXd shares = w(members) / w(members).sum();
    const MatrixXd offset = population.u(Eigen::all, members).colwise() - about;
    MatrixXd covariance = h * h * offset * shares.asDiagonal() * offset.transpose();
    covariance.diagonal().array() += 1e-9 * std::max(covariance.diagonal().maxCoeff(), 1e-9);
    return covariance;
  };
  std::vector<Index> all(static_cast<size_t>(count));
  std::iota(all.begin(), all.end(), 0);
  GaussianMixture kernels{{w.begin(), w.end()}, {}};
  const Index neighbours = std::max(count / 4, std::min(count, n + 2));
  for (Index i = 0; i < count; ++i) {
    const VectorXd squared = (population.u.colwise() - population.u.col(i)).colwise().squaredNorm();
    std::vector<Index> near = all;
    std::nth_element(near.begin(), near.begin() + (neighbours - 1), near.end(),
                     [&](Index a, Index b) {
                       return squared(a) != squared(b) ? squared(a) < squared(b) : a < b;
                     });
    near.resize(static_cast<size_t>(neighbours));
    std::sort(near.begin(), near.end());
    kernels.components.push_back({population.u.col(i), spread(near, population.u.col(i))});
  }
  return kernels;
}

// Importance weights of draws u from the kernels, against the standard normal prior.
VectorXd ImportanceWeights(const MatrixXd& u, const GaussianMixture& kernels) {
  const VectorXd log_weights =
      -0.5 * u.colwise().squaredNorm().transpose() - LogDensities(kernels, u);
  const VectorXd weights = (log_weights.array() - log_weights.maxCoeff()).max(-700).exp();
  return weights / weights.sum();
}

// The smallest value that at least this share of them does not exceed.
double NearestRankQuantile(VectorXd values, double share) {
  std::sort(values.begin(), values.end());
  const auto rank = static_cast<Index>(std::ceil(share * static_cast<double>(values.size())));
  return values(std::clamp<Index>(rank - 1, 0, values.size() - 1));
}

class Smc {
 public:
  Smc(const Problem& problem, const SmcOptions& options, uint64_t seed)
      : problem_(problem), options_(options), seed_(seed) {}

  Posterior Infer() {
    for (uint32_t t = 0; simulations_ < options_.simulations; ++t) {
      const Generation generation = Propose(t);
      const auto accepted = static_cast<int>(generation.accepted.size());
      // Half a generation is still one, and the only one there may ever be.
      if (accepted < 2 || (t > 0 && accepted < options_.population / 2)) break;
      Succeed(generation);
      if (generation.acceptance() < options_.min_acceptance || !Narrow()) break;
    }
    Random random(seed_, {kSmcPosteriorStream});
    Posterior posterior = AbcPosterior(problem_.prior, Kept(), options_.samples, random);
    posterior.simulations = simulations_;
    posterior.failures = failures_;
    return posterior;
  }
  const SmcDiagnostics& diagnostics() const { return diagnostics_; }

 private:
  bool first() const { return kernels_.components.empty(); }

  // Simulates until as many are accepted as a population has.
  Generation Propose(uint32_t t) {
    const auto full = static_cast<size_t>(options_.population);
    Generation generation(problem_.prior.size(), problem_.observed.size());
    Random random(seed_, {kSmcProposals, t});
    while (generation.accepted.size() < full && simulations_ < options_.simulations) {
      const Index batch = std::min<Index>(options_.population, options_.simulations - simulations_);
      const MatrixXd u = first() ? StandardNormals(problem_.prior.size(), batch, random)
                                 : Sample(kernels_, batch, random);
      const MatrixXd outcomes = problem_.simulate(problem_.prior.FromStandard(u), simulations_);
      const Index before = generation.u.cols();
      generation.Add(u, outcomes);
      const VectorXd d = Distances(options_.distance, outcomes, problem_.observed,
                                   first() ? VectorXd::Ones(problem_.observed.size()) : scale_);
      for (Index j = 0; j < batch; ++j) {
        failures_ += !outcomes.col(j).allFinite();
        if (d(j) <= epsilon_ && generation.accepted.size() < full)
          generation.accepted.push_back(before + j);
      }
      simulations_ += batch;
    }
    return generation;
  }

  // The accepted ones are the population.
  void Succeed(const Generation& generation) {
    const auto accepted = static_cast<Index>(generation.accepted.size());
    population_.u = generation.u(Eigen::all, generation.accepted);
    population_.outcomes = generation.outcomes(Eigen::all, generation.accepted);
    population_.weights = first() ? VectorXd::Constant(accepted, 1. / static_cast<double>(accepted))
                                  : ImportanceWeights(population_.u, kernels_);
    diagnostics_.generations.push_back({epsilon_, generation.u.cols(), static_cast<int>(accepted),
                                        1 / population_.weights.squaredNorm()});
    scale_ = RobustScale(generation.outcomes, problem_.observed);
    distances_ = Distances(options_.distance, population_.outcomes, problem_.observed, scale_);
  }

  // The next epsilon, and the kernels to draw from. A change of scale changes the unit of epsilon,
  // too: compared is the quantile with the largest distance now. @return false if it hardly falls.
  bool Narrow() {
    const double next = NearestRankQuantile(distances_, options_.quantile);
    if (!(next < (1 - options_.min_change) * distances_.maxCoeff())) return false;
    epsilon_ = next;
    kernels_ = Kernels(population_);
    return true;
  }

  std::optional<AdjustedSamples> Kept() const {
    if (population_.u.cols() == 0) return std::nullopt;
    if (!options_.adjust) return AdjustedSamples{population_.u, population_.weights};
    return AdjustByRegression(population_.u, population_.outcomes, problem_.observed, distances_,
                              population_.weights);
  }

  const Problem& problem_;
  const SmcOptions& options_;
  const uint64_t seed_;
  int64_t simulations_ = 0, failures_ = 0;
  Population population_;
  GaussianMixture kernels_;
  VectorXd scale_, distances_;  // the scale now in use; the population's distances by it
  // The first generation accepts everything that did not fail.
  double epsilon_ = std::numeric_limits<double>::max();
  SmcDiagnostics diagnostics_;
};

}  // namespace

Posterior InferBySmc(const Problem& problem, const SmcOptions& options, uint64_t seed,
                     SmcDiagnostics* diagnostics) {
  if (options.simulations < 1 || options.population < 2 || options.samples < 1 ||
      !(options.quantile > 0 && options.quantile < 1) || problem.observed.array().isNaN().all()) {
    throw std::invalid_argument(
        "SMC needs simulations, a population, samples, a quantile in (0, 1), an observation");
  }
  Smc smc(problem, options, seed);
  Posterior posterior = smc.Infer();
  if (diagnostics) *diagnostics = smc.diagnostics();
  return posterior;
}

}  // namespace plumb
