#include "calibrator/inference/abc_rejection.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "calibrator/inference/distances.h"
#include "calibrator/inference/gaussian_mixture.h"
#include "calibrator/inference/kernel_density.h"
#include "calibrator/inference/regression_adjustment.h"

namespace plumb {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

constexpr uint32_t kParameters = 1, kSamples = 2;  // first stream words
constexpr int kMaxKernels = 2'000, kMaxFitted = 2'000, kMaxComponents = 16;

}  // namespace

Posterior InferByRejection(const Problem& problem, const RejectionOptions& options, uint64_t seed,
                           RejectionDiagnostics* diagnostics) {
  if (options.simulations < 1 || options.batch < 1 || options.samples < 1 ||
      !(options.fraction > 0 && options.fraction <= 1) || problem.observed.array().isNaN().all()) {
    throw std::invalid_argument(
        "rejection needs simulations, samples, a fraction in (0, 1] and an observation");
  }
  Posterior posterior;
  const Index n = problem.prior.size(), total = options.simulations;
  Random draws(seed, {kParameters});
  const MatrixXd u = StandardNormals(n, total, draws);
  MatrixXd outcomes(problem.observed.size(), total);
  for (Index first = 0; first < total; first += options.batch) {
    const Index count = std::min<Index>(options.batch, total - first);
    outcomes.middleCols(first, count) =
        problem.simulate(problem.prior.FromStandard(u.middleCols(first, count)), first);
  }
  const VectorXd distances = Distances(options.distance, outcomes, problem.observed,
                                       RobustScale(outcomes, problem.observed));

  std::vector<Index> order(static_cast<size_t>(total));
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](Index a, Index b) { return distances(a) < distances(b); });
  order.resize(static_cast<size_t>(std::ceil(options.fraction * static_cast<double>(total))));
  while (!order.empty() && !std::isfinite(distances(order.back()))) order.pop_back();
  const VectorXd equal = VectorXd::Ones(static_cast<Index>(order.size()));

  Random random(seed, {kSamples});
  if (order.empty()) {
    posterior.samples = problem.prior.Sample(options.samples, random);
  } else {
    AdjustedSamples kept{u(Eigen::all, order), equal};
    if (options.adjust) {
      kept = AdjustByRegression(kept.samples, outcomes(Eigen::all, order), problem.observed,
                                distances(order), equal);
    }
    const GaussianMixture density = KernelDensity(kept.samples, kept.weights, kMaxKernels, random);
    posterior.samples = problem.prior.FromStandard(Sample(density, options.samples, random));
  }
  const Index some = std::min<Index>(options.samples, kMaxFitted);
  posterior.mixture =
      SelectMixture(posterior.samples.leftCols(some), VectorXd::Ones(some), kMaxComponents, random)
          .mixture;
  posterior.simulations = total;
  for (const auto column : outcomes.colwise()) posterior.failures += !column.allFinite();
  if (diagnostics) {
    diagnostics->kept = static_cast<int64_t>(order.size());
    diagnostics->epsilon = order.empty() ? 0 : distances(order.back());
  }
  return posterior;
}

}  // namespace plumb
