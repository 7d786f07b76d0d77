#include "calibrator/inference/abc_rejection.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <vector>

#include "calibrator/inference/abc_posterior.h"
#include "calibrator/inference/distances.h"
#include "calibrator/inference/regression_adjustment.h"

namespace plumb {
namespace {

using Eigen::Index, Eigen::MatrixXd, Eigen::VectorXd;

constexpr uint32_t kParameterStream = 1, kPosteriorStream = 2;  // first stream words

}  // namespace

Posterior InferByRejection(const Problem& problem, const RejectionOptions& options, uint64_t seed,
                           RejectionDiagnostics* diagnostics) {
  if (options.simulations < 1 || options.batch < 1 || options.samples < 1 ||
      !(options.fraction > 0 && options.fraction <= 1) || problem.observed.array().isNaN().all()) {
    throw std::invalid_argument(
        "rejection needs simulations, samples, a fraction in (0, 1] and an observation");
  }
  const Index n = problem.prior.size(), total = options.simulations;
  Random draws(seed, {kParameterStream});
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

  std::optional<AdjustedSamples> kept;
  if (!order.empty() && options.adjust) {
    kept = AdjustByRegression(u(Eigen::all, order), outcomes(Eigen::all, order), problem.observed,
                              distances(order), equal);
  } else if (!order.empty()) {
    kept = {u(Eigen::all, order), equal};
  }
  Random random(seed, {kPosteriorStream});
  Posterior posterior = AbcPosterior(problem.prior, kept, options.samples, random);
  posterior.simulations = total;
  for (const auto column : outcomes.colwise()) posterior.failures += !column.allFinite();
  if (diagnostics) {
    diagnostics->kept = static_cast<int64_t>(order.size());
    diagnostics->epsilon = order.empty() ? 0 : distances(order.back());
  }
  return posterior;
}

}  // namespace plumb
