#include "cli/calibrate_sbc.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iostream>
#include <memory>
#include <utility>

#include "calibrator/diagnostics/robot_sbc.h"
#include "calibrator/results/calibration.h"
#include "common/special_numbers.h"

namespace plumb {
namespace {

// As SbcSummary has it.
bool Significant(double p, size_t tests) {
  constexpr double kLevel = 0.01;
  return p * static_cast<double>(tests) < kLevel;
}

}  // namespace

int FewestPosteriors(int draws, size_t tests) {
  const std::array<std::pair<int, int>, 3> worst_ranks{
      {{0, 0}, {0, draws}, {draws / 2, (draws + 1) / 2}}};
  for (int posteriors = 1;; ++posteriors) {
    const auto found_out = [&](const std::pair<int, int>& worst) {
      std::vector<int> ranks;
      for (int i = 0; i < posteriors; ++i) ranks.push_back(i % 2 == 0 ? worst.first : worst.second);
      return Significant(std::min(UniformityByChi2(ranks, draws), UniformityByEcdf(ranks, draws)),
                         tests);
    };
    if (std::ranges::all_of(worst_ranks, found_out)) return posteriors;
  }
}

int JudgePosteriors(const RobotDescription& robot, const std::vector<Log>& logs,
                    const CalibrationOptions& options, int runs, bool strict) {
  CalibrationOptions for_noise = options;  // of which nothing else is needed
  for_noise.method = "laplace", for_noise.horizons = {1}, for_noise.residual = false;
  const Findings findings = Calibrate(robot, logs, for_noise);
  const std::vector<Rollout> rollouts = RolloutsOf(logs);
  RobotSbcOptions sbc;
  sbc.runs = runs, sbc.seed = options.seed, sbc.threads = options.execution.threads;
  sbc.progress = [&](double share) { options.progress("simulation-based calibration", share); };
  SbcResult result = RunRobotSbc(std::make_shared<Model>(robot), rollouts, findings.noise_sd, sbc);

  const size_t tests = 2 * result.quantities.size();
  const int posteriors = result.runs - result.failures, fewest = FewestPosteriors(sbc.draws, tests);
  bool calibrated = posteriors >= fewest;
  for (SbcUniformity& quantity : result.quantities) {
    const bool wrong = Significant(std::min(quantity.chi2_p, quantity.ecdf_p), tests);
    // SbcSummary then says "unknown" in place of "calibrated".
    if (!wrong && posteriors < fewest) quantity.chi2_p = kNaN;
    calibrated = calibrated && !wrong;
  }
  std::cout << SbcSummary(result);
  if (posteriors < fewest) {
    std::cout << fmt::format(
        "unknown: {} posteriors are too few to tell; with fewer than {} not even those that are as "
        "wrong as can be are found out\n",
        posteriors, fewest);
  }
  std::cout << std::flush;
  return strict && !calibrated ? 3 : 0;
}

}  // namespace plumb
