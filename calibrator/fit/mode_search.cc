#include "calibrator/fit/mode_search.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "calibrator/fit/robot_least_squares.h"
#include "calibrator/fit/window_errors.h"
#include "calibrator/inference/noise.h"
#include "common/decompositions.h"
#include "common/random.h"

namespace plumb {
namespace {

constexpr int64_t kSearchWindows = 40;  // the shortest, that are enough to find a mode
constexpr double kSameMode = 4;         // [sd] between two answers that count as one

// @param found the best first. @param every of how many windows one was looked at.
std::vector<Eigen::VectorXd> DistinctModes(const std::vector<LaplaceFit>& found, int every) {
  // With a part of the evidence the difference is that much smaller.
  const double share = static_cast<double>(every);
  std::vector<Eigen::VectorXd> modes;
  std::vector<const LaplaceFit*> kept;
  for (const LaplaceFit& fit : found) {
    if (fit.log_posterior < found[0].log_posterior - std::max(3.0, kWorthless / share)) continue;
    if (std::any_of(kept.begin(), kept.end(),
                    [&](const LaplaceFit* other) { return !AreDistinct(fit, *other); }))
      continue;
    kept.push_back(&fit);
    modes.push_back(fit.mode);
  }
  return modes;
}

}  // namespace

std::vector<Eigen::VectorXd> FirstGuesses(const Prior& prior, int count, uint64_t seed,
                                          const Eigen::VectorXd& start) {
  std::vector<Eigen::VectorXd> guesses{start};
  if (start.size() == 0) guesses[0] = prior.FromStandard(Eigen::VectorXd::Zero(prior.size()));
  for (int i = 1; i < count; ++i) {
    Random random(seed, {0x57a57, static_cast<uint32_t>(i)});
    guesses.push_back(prior.Sample(1, random));
  }
  return guesses;
}

FoundModes SearchModes(const std::shared_ptr<const Model>& model, std::span<const Rollout> rollouts,
                       int horizon, int64_t windows, std::span<const Eigen::VectorXd> guesses,
                       const ExecutionOptions& execution,
                       const std::function<void(size_t led)>& progress) {
  const auto every = static_cast<int>(std::max<int64_t>(1, windows / kSearchWindows));
  const RobotDescription& robot = model->description();
  LaplaceOptions quick;
  quick.sandwich = quick.robust = quick.jacobian_at_end = false;
  quick.tolerance = 0.3;
  FoundModes result;
  std::vector<LaplaceFit> found;
  std::string last_error = "no first guess can be simulated";
  for (const Eigen::VectorXd& guess : guesses) {
    WindowErrors part(model, rollouts, horizon, execution, every);
    try {
      part.Linearise(robot.ToPhysical(guess));
      found.push_back(FitLaplace(ProblemOf(robot, part), guess, quick));
      found.back().log_posterior -= part.LogSpread();
      result.simulations += found.back().simulations;
    } catch (const std::invalid_argument& error) {
      last_error = error.what();
      ++result.impossible;
    }
    result.simulated_steps += part.simulated_steps();
    result.failures += part.failures();
    // nothing is left to explain
    if (!found.empty() && (found.back().scale.array() <= Noise::kLeastScale).all()) break;
    progress(found.size());
  }
  if (found.empty()) throw std::invalid_argument(last_error);
  std::stable_sort(found.begin(), found.end(),
                   [](const auto& a, const auto& b) { return a.log_posterior > b.log_posterior; });
  result.modes = DistinctModes(found, every);
  return result;
}

bool AreDistinct(const LaplaceFit& a, const LaplaceFit& b) {
  const Eigen::VectorXd offset = a.standard.mean - b.standard.mean;
  const Eigen::MatrixXd spread = a.standard.covariance + b.standard.covariance;
  return std::sqrt(offset.dot(spread.llt().solve(offset))) > kSameMode;
}

}  // namespace plumb
