#include "calibrator/inference/sbc.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "calibrator/inference/chi_squared.h"
#include "common/special_numbers.h"

namespace plumb {
namespace {

constexpr int kMaxBins = 20;
// expected; fewer, and the statistic is not chi-squared distributed
constexpr int kFewestPerBin = 5;
constexpr int kMaxPoints = 100;                   // at which distribution functions are compared
constexpr double kNegligibleProbability = 1e-20;  // a probability
constexpr double kSignificant = 0.01;
constexpr int kMostToTell = 100;  // posteriors; of three draws or fewer the worst are hardly told
constexpr uint32_t kTieStream = 0x54494553;  // "TIES"

/// Probabilities of a binomial distribution, by logarithms of factorials.
class BinomialPmf {
 public:
  explicit BinomialPmf(int most) : log_factorial_(static_cast<size_t>(most) + 1) {
    for (size_t i = 1; i < log_factorial_.size(); ++i) {
      log_factorial_[i] = log_factorial_[i - 1] + std::log(static_cast<double>(i));
    }
  }
  double operator()(int successes, int trials, double p) const {
    return std::exp(At(trials) - At(successes) - At(trials - successes) + successes * std::log(p) +
                    (trials - successes) * std::log1p(-p));
  }

 private:
  double At(int i) const { return log_factorial_[static_cast<size_t>(i)]; }
  std::vector<double> log_factorial_;
};

// Two-sided tail probability of each count from 0 to n; sums from either end, so that small ones
// are exact.
std::vector<double> TailProbabilities(int n, double share, const BinomialPmf& pmf) {
  const auto size = static_cast<size_t>(n) + 1;
  std::vector<double> at_most(size), at_least(size), tail(size);
  for (size_t i = 0; i < size; ++i) at_most[i] = at_least[i] = pmf(static_cast<int>(i), n, share);
  for (size_t i = 1; i < size; ++i) at_most[i] += at_most[i - 1];
  for (size_t i = size - 1; i > 0; --i) at_least[i - 1] += at_least[i];
  for (size_t i = 0; i < size; ++i) tail[i] = std::min(1.0, 2 * std::min(at_most[i], at_least[i]));
  return tail;
}

// How many of the ranks are below `bound`; ranks ascend.
int CountBelow(const std::vector<int>& ranks, int bound) {
  return static_cast<int>(std::lower_bound(ranks.begin(), ranks.end(), bound) - ranks.begin());
}

// Share of the quantile interval [rank, rank + 1] / (draws + 1) that the central interval of a
// level holds.
double Covered(int rank, int draws, double level) {
  const double lower = (1 - level) / 2 * (draws + 1), upper = (1 + level) / 2 * (draws + 1);
  return std::clamp(std::min(upper, rank + 1.0) - std::max<double>(lower, rank), 0.0, 1.0);
}

SbcUniformity Judge(const std::string& name, const std::vector<int>& ranks, int draws) {
  SbcUniformity found{name, kNaN, kNaN, {kNaN, kNaN, kNaN}, kNaN, kNaN};
  if (ranks.empty()) return found;
  found.chi2_p = UniformityByChi2(ranks, draws);
  found.ecdf_p = UniformityByEcdf(ranks, draws);
  const auto n = static_cast<double>(ranks.size());
  for (size_t i = 0; i < SbcUniformity::kLevels.size(); ++i) {
    double sum = 0;
    for (const int rank : ranks) sum += Covered(rank, draws, SbcUniformity::kLevels[i]);
    found.coverage[i] = sum / n;
  }
  double sum = 0, squares = 0;
  const auto share = [&](int rank) { return (rank + 0.5) / (draws + 1); };
  for (const int rank : ranks) sum += share(rank);
  for (const int rank : ranks) squares += std::pow(share(rank) - sum / n, 2);
  found.mean = sum / n;
  found.variance = squares / n;
  return found;
}

int Rank(double truth, const Eigen::VectorXd& draws, Random& ties) {
  const auto below = static_cast<int>((draws.array() < truth).count());
  const auto equal = static_cast<uint32_t>((draws.array() == truth).count());
  return below + (equal > 0 ? static_cast<int>(ties.Uniform() * (equal + 1)) : 0);
}

bool Significant(double chi2_p, double ecdf_p, size_t tests) {
  return std::min(chi2_p, ecdf_p) * static_cast<double>(tests) < kSignificant;
}

// In what way it is wrong most, in standard errors of uniform ranks' mean and variance.
std::string Verdict(const SbcUniformity& quantity, double runs, size_t tests, bool enough) {
  if (!Significant(quantity.chi2_p, quantity.ecdf_p, tests))
    return enough && !std::isnan(quantity.chi2_p) ? kSbcCalibrated : kSbcUnknown;
  const double shift = (quantity.mean - 0.5) * std::sqrt(12 * runs);
  const double width = (12 * quantity.variance - 1) * std::sqrt(runs / 0.8);
  if (std::abs(shift) > std::abs(width)) return shift > 0 ? "too low" : "too high";
  if (std::abs(width) > 2) return width > 0 ? "too sure" : "too unsure";
  return "of another shape";
}

}  // namespace

std::vector<SbcQuantity> Marginals(const std::vector<std::string>& names) {
  std::vector<SbcQuantity> quantities;
  for (const std::string& name : names) {
    const auto i = static_cast<Eigen::Index>(quantities.size());
    quantities.push_back({name, [i](const Eigen::VectorXd& parameters) { return parameters(i); }});
  }
  return quantities;
}

double UniformityByChi2(const std::vector<int>& ranks, int draws) {
  const auto n = static_cast<int>(ranks.size());
  const int bins = std::min({kMaxBins, n / kFewestPerBin, draws + 1});
  if (bins < 2) return 1;
  // Bins of whole ranks; not all of them have as many.
  const auto bin = [&](int rank) {
    return static_cast<size_t>(static_cast<int64_t>(rank) * bins / (draws + 1));
  };
  std::vector<double> expected(static_cast<size_t>(bins)), observed(expected);
  for (int rank = 0; rank <= draws; ++rank)
    expected[bin(rank)] += static_cast<double>(n) / (draws + 1);
  for (const int rank : ranks) observed[bin(rank)] += 1;
  double chi2 = 0;
  for (size_t i = 0; i < expected.size(); ++i)
    chi2 += std::pow(observed[i] - expected[i], 2) / expected[i];
  return ChiSquaredTail(bins - 1, chi2);
}

// At each point the number of ranks below it is binomial. The statistic is the least tail
// probability of these numbers; its own distribution follows from the probability of a path of
// counts that nowhere has so small a one. Counts are a Markov chain: of those not below one point,
// each is below the next with the same probability.
double UniformityByEcdf(const std::vector<int>& ranks, int draws) {
  std::vector<int> sorted = ranks;
  std::sort(sorted.begin(), sorted.end());
  const auto n = static_cast<int>(ranks.size());
  std::vector<int> points;
  const int count = std::min(kMaxPoints, draws);
  for (int i = 1; i <= count; ++i) {
    points.push_back(static_cast<int>(static_cast<int64_t>(i) * (draws + 1) / (count + 1)));
  }

  const BinomialPmf pmf(n);
  double least = 1;
  for (const int point : points) {
    const auto below = static_cast<size_t>(CountBelow(sorted, point));
    least = std::min(least, TailProbabilities(n, point / (draws + 1.0), pmf)[below]);
  }

  // Probability of each count and of no excursion so far.
  std::vector<double> inside(static_cast<size_t>(n) + 1);
  inside[0] = 1;
  double before = 0;  // share of ranks below the point before
  for (const int point : points) {
    const double share = point / (draws + 1.0), step = (share - before) / (1 - before);
    const std::vector<double> tail = TailProbabilities(n, share, pmf);
    std::vector<double> next(inside.size());
    for (int from = 0; from <= n; ++from) {
      const double here = inside[static_cast<size_t>(from)];
      if (here == 0) continue;
      for (int to = from; to <= n; ++to) {
        const double p = pmf(to - from, n - from, step);
        if (p < kNegligibleProbability && to - from > (n - from) * step) break;
        // The observed path is an excursion itself, whatever the rounding.
        if (tail[static_cast<size_t>(to)] > least * (1 + 1e-9))
          next[static_cast<size_t>(to)] += here * p;
      }
    }
    inside = std::move(next);
    before = share;
  }
  double stays = 0;
  for (const double p : inside) stays += p;
  return std::clamp(1 - stays, 0.0, 1.0);
}

SbcResult RunSbc(const Prior& prior, const SbcFit& fit, const std::vector<SbcQuantity>& quantities,
                 int runs, uint64_t seed) {
  if (runs < 1) throw std::invalid_argument("simulation-based calibration needs at least one run");
  if (quantities.empty())
    throw std::invalid_argument("simulation-based calibration needs a quantity");
  const auto k = static_cast<Eigen::Index>(quantities.size());
  SbcResult result;
  result.runs = runs;
  result.ranks.setConstant(runs, k, SbcResult::kFailed);
  for (int run = 0; run < runs; ++run) {
    Random random(seed, {static_cast<uint32_t>(run)}),
        ties(seed, {static_cast<uint32_t>(run), kTieStream});
    const Eigen::VectorXd truth = prior.Sample(1, random);
    const std::optional<Eigen::MatrixXd> posterior = fit(truth, random);
    if (!posterior || !posterior->allFinite()) {
      ++result.failures;
      continue;
    }
    const auto draws = static_cast<int>(posterior->cols());
    if (posterior->rows() != prior.size() || draws < 1 ||
        (result.draws > 0 && draws != result.draws)) {
      throw std::invalid_argument(fmt::format(
          "a posterior of {} parameters with {} draws: {} were expected", posterior->rows(), draws,
          result.draws > 0 ? fmt::format("{} with {}", prior.size(), result.draws)
                           : fmt::format("{} with one at least", prior.size())));
    }
    result.draws = draws;
    for (Eigen::Index i = 0; i < k; ++i) {
      const auto& of = quantities[static_cast<size_t>(i)].of;
      Eigen::VectorXd values(draws);
      for (Eigen::Index j = 0; j < draws; ++j) values(j) = of(posterior->col(j));
      const double true_value = of(truth);
      if (std::isnan(true_value) || values.array().isNaN().any()) {
        throw std::invalid_argument("quantity '" + quantities[static_cast<size_t>(i)].name +
                                    "' is not a number");
      }
      result.ranks(run, i) = Rank(true_value, values, ties);
    }
  }
  for (Eigen::Index i = 0; i < k; ++i) {
    std::vector<int> ranks;
    for (const int rank : result.ranks.col(i)) {
      if (rank != SbcResult::kFailed) ranks.push_back(rank);
    }
    result.quantities.push_back(
        Judge(quantities[static_cast<size_t>(i)].name, ranks, result.draws));
  }
  return result;
}

int FewestPosteriors(int draws, size_t tests) {
  const std::array<std::pair<int, int>, 3> worst_ranks{
      {{0, 0}, {0, draws}, {draws / 2, (draws + 1) / 2}}};
  std::array<std::vector<int>, 3> ranks;
  for (int posteriors = 1; posteriors < kMostToTell; ++posteriors) {
    bool found_out = true;
    for (size_t i = 0; i < ranks.size(); ++i) {
      const auto& [one, other] = worst_ranks[i];
      ranks[i].push_back(posteriors % 2 == 1 ? one : other);
      found_out = found_out && Significant(UniformityByChi2(ranks[i], draws),
                                           UniformityByEcdf(ranks[i], draws), tests);
    }
    if (found_out) return posteriors;
  }
  return kMostToTell;
}

std::vector<std::string> SbcVerdicts(const SbcResult& result) {
  const int posteriors = result.runs - result.failures;
  const size_t tests = 2 * result.quantities.size();
  const bool enough = posteriors > 0 && posteriors >= FewestPosteriors(result.draws, tests);
  std::vector<std::string> verdicts;
  for (const SbcUniformity& quantity : result.quantities)
    verdicts.push_back(Verdict(quantity, posteriors, tests, enough));
  return verdicts;
}

std::string SbcSummary(const SbcResult& result) {
  const int posteriors = result.runs - result.failures;
  const std::vector<std::string> verdicts = SbcVerdicts(result);
  size_t width = 8;
  for (const SbcUniformity& quantity : result.quantities)
    width = std::max(width, quantity.name.size());
  std::string text =
      fmt::format("{} posteriors of {} draws each; {} of {} runs failed ({:.1f} %){}\n", posteriors,
                  result.draws, result.failures, result.runs, 100.0 * result.failures / result.runs,
                  result.failures > 0 ? ": of these nothing is known" : "");
  text += fmt::format("{:<{}}  {:>8}  {:>8}  {:>6}  {:>6}  {:>6}  posterior\n", "quantity", width,
                      "chi2 p", "ECDF p", "50 %", "80 %", "95 %");
  for (size_t i = 0; i < verdicts.size(); ++i) {
    const SbcUniformity& quantity = result.quantities[i];
    text += fmt::format("{:<{}}  {:>8.2g}  {:>8.2g}", quantity.name, width, quantity.chi2_p,
                        quantity.ecdf_p);
    for (const double coverage : quantity.coverage)
      text += fmt::format("  {:>6.1f}", 100 * coverage);
    text += "  " + verdicts[i] + "\n";
  }
  const int fewest =
      result.draws > 0 ? FewestPosteriors(result.draws, 2 * result.quantities.size()) : 0;
  if (posteriors < fewest) {
    text += fmt::format(
        "unknown: {} posteriors are too few to tell; with fewer than {} not even those that are as "
        "wrong as can be are found out\n",
        posteriors, fewest);
  }
  return text;
}

}  // namespace plumb
