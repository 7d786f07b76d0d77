#include "trainer/evaluation.h"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <numeric>
#include <vector>

#include "common/quantile.h"

namespace plumb {
namespace {

std::vector<double> Ordered(std::span<const double> returns) {
  std::vector<double> ordered;
  std::copy_if(returns.begin(), returns.end(), std::back_inserter(ordered),
               [](double x) { return std::isfinite(x); });
  std::sort(ordered.begin(), ordered.end());
  return ordered;
}

}  // namespace

Evaluation Evaluate(std::span<const double> returns) {
  const std::vector<double> ordered = Ordered(returns);
  Evaluation evaluation;
  evaluation.episodes = static_cast<int>(returns.size());
  evaluation.failed = static_cast<int>(returns.size() - ordered.size());
  if (ordered.empty()) return evaluation;
  evaluation.mean =
      std::accumulate(ordered.begin(), ordered.end(), 0.) / static_cast<double>(ordered.size());
  evaluation.tenth = Quantile(ordered, 0.1);
  evaluation.worst = ordered.front();
  return evaluation;
}

double MeanOfWorst(std::span<const double> returns, double share) {
  const std::vector<double> ordered = Ordered(returns);
  const auto count = static_cast<ptrdiff_t>(std::ceil(share * static_cast<double>(ordered.size())));
  return std::accumulate(ordered.begin(), ordered.begin() + count, 0.) / static_cast<double>(count);
}

double Scatter(std::span<const double> returns) {
  const std::vector<double> ordered = Ordered(returns);
  if (ordered.size() < 2) return 0;
  const Eigen::Map<const Eigen::ArrayXd> values(ordered.data(), std::ssize(ordered));
  return std::sqrt((values - values.mean()).square().sum() /
                   static_cast<double>(ordered.size() - 1));
}

std::string Summary(const Evaluation& evaluation) {
  std::string words = fmt::format("{:.1f} mean, {:.1f} 10th percentile, {:.1f} worst",
                                  evaluation.mean, evaluation.tenth, evaluation.worst);
  if (evaluation.failed > 0)
    words += fmt::format(" ({} of {} failed)", evaluation.failed, evaluation.episodes);
  return words;
}

}  // namespace plumb
