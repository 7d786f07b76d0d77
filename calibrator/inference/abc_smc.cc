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
  MatrixXd u, outcomes;
  std::vector<Index> accepted;
};

// Covariance of each member's kernel.
GaussianMixture Kernels(const Population& population, bool local) {
  const Index count = population.u.cols(), n = population.u.rows();
  const VectorXd& w = population.weights;
  const double h = Bandwidth(1 / w.squaredNorm(), n, BandwidthRule::kSilverman);
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
  const MatrixXd global = spread(all, population.u * w);
  const Index neighbours = std::max(count / 4, std::min(count, n + 2));
  for (Index i = 0; i < count; ++i) {
    if (!local) {
      kernels.components.push_back({population.u.col(i), global});
      continue;
    }
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

double Quantile(VectorXd values, double share) {
  std::sort(values.begin(), values.end());
  const auto rank = static_cast<Index>(std::ceil(share * static_cast<double>(values.size())));
  return values(std::clamp<Index>(rank - 1, 0, values.size() - 1));
}

}  // namespace

Posterior InferBySmc(const Problem& problem, const SmcOptions& options, uint64_t seed,
                     SmcDiagnostics* diagnostics) {
  if (options.simulations < 1 || options.population < 2 || options.samples < 1 ||
      !(options.quantile > 0 && options.quantile < 1) || problem.observed.array().isNaN().all()) {
    throw std::invalid_argument(
        "SMC needs simulations, a population, samples, a quantile in (0, 1), an observation");
  }
  const Index n = problem.prior.size();
  const VectorXd& observed = problem.observed;
  int64_t simulations = 0, failures = 0;
  SmcDiagnostics report;
  Population population;
  GaussianMixture kernels;
  VectorXd scale, distances;  // the scale now in use; the population's distances by it
  // The first generation accepts everything that did not fail.
  double epsilon = std::numeric_limits<double>::max();

  for (uint32_t t = 0; simulations < options.simulations; ++t) {
    Generation generation{MatrixXd(n, 0), MatrixXd(observed.size(), 0), {}};
    Random random(seed, {kSmcProposals, t});
    while (static_cast<int>(generation.accepted.size()) < options.population &&
           simulations < options.simulations) {
      const Index batch = std::min<Index>(options.population, options.simulations - simulations);
      const MatrixXd u =
          t == 0 ? StandardNormals(n, batch, random) : Sample(kernels, batch, random);
      const MatrixXd outcomes = problem.simulate(problem.prior.FromStandard(u), simulations);
      const Index before = generation.u.cols();
      generation.u.conservativeResize(Eigen::NoChange, before + batch);
      generation.outcomes.conservativeResize(Eigen::NoChange, before + batch);
      generation.u.rightCols(batch) = u;
      generation.outcomes.rightCols(batch) = outcomes;
      const VectorXd d = Distances(options.distance, outcomes, observed,
                                   t == 0 ? VectorXd::Ones(observed.size()) : scale);
      for (Index j = 0; j < batch; ++j) {
        failures += !outcomes.col(j).allFinite();
        if (d(j) <= epsilon && static_cast<int>(generation.accepted.size()) < options.population) {
          generation.accepted.push_back(before + j);
        }
      }
      simulations += batch;
    }
    const auto accepted = static_cast<int>(generation.accepted.size());
    // Half a generation is still one, and the only one there may ever be.
    if (accepted < 2 || (t > 0 && accepted < options.population / 2)) break;

    const MatrixXd u = generation.u(Eigen::all, generation.accepted);
    const VectorXd weights =
        t == 0 ? VectorXd::Constant(accepted, 1. / accepted) : ImportanceWeights(u, kernels);
    population = {u, generation.outcomes(Eigen::all, generation.accepted), weights};
    report.generations.push_back(
        {epsilon, generation.u.cols(), accepted, 1 / weights.squaredNorm()});
    scale = RobustScale(generation.outcomes, observed);
    distances = Distances(options.distance, population.outcomes, observed, scale);
    const double next = Quantile(distances, options.quantile);
    // A change of scale changes the unit of epsilon, too: compared is the quantile with the largest
    // distance now.
    const double acceptance =
        static_cast<double>(accepted) / static_cast<double>(generation.u.cols());
    if (acceptance < options.min_acceptance ||
        !(next < (1 - options.min_change) * distances.maxCoeff()))
      break;
    epsilon = next;
    kernels = Kernels(population, options.local_kernels);
  }

  std::optional<AdjustedSamples> kept;
  if (population.u.cols() > 0 && options.adjust) {
    kept = AdjustByRegression(population.u, population.outcomes, observed, distances,
                              population.weights);
  } else if (population.u.cols() > 0) {
    kept = {population.u, population.weights};
  }
  Random random(seed, {kSmcPosteriorStream});
  Posterior posterior = AbcPosterior(problem.prior, kept, options.samples, random);
  posterior.simulations = simulations;
  posterior.failures = failures;
  if (diagnostics) *diagnostics = std::move(report);
  return posterior;
}

}  // namespace plumb
