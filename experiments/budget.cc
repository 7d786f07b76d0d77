#include "experiments/budget.h"

#include <algorithm>
#include <stdexcept>

#include "calibrator/fit/discrepancy.h"
#include "calibrator/fit/methods.h"
#include "robot/parameter_distribution.h"

namespace plumb {
namespace {

constexpr int64_t kFewest = 10;
constexpr int64_t kCheapest = 50;  // simulated steps for a transition
constexpr size_t kStretch = 25;    // transitions

}  // namespace

std::vector<Rollout> FirstTransitions(const std::vector<Rollout>& rollouts, int64_t count) {
  std::vector<Rollout> first;
  for (const Rollout& rollout : rollouts) {
    if (count <= 0) break;
    first.push_back(rollout);
    auto& transitions = first.back().transitions;
    if (static_cast<int64_t>(transitions.size()) > count)
      transitions.resize(static_cast<size_t>(count));
    count -= static_cast<int64_t>(transitions.size());
  }
  return first;
}

std::vector<Rollout> SpreadTransitions(const std::vector<Rollout>& rollouts, int64_t count) {
  std::vector<Rollout> all;
  for (const Rollout& rollout : rollouts) {
    for (size_t first = 0; first < rollout.transitions.size(); first += kStretch) {
      const auto begin = rollout.transitions.begin() + static_cast<ptrdiff_t>(first);
      Rollout stretch{rollout.episode, rollout.policy_iteration, {}};
      stretch.transitions.assign(begin, begin + static_cast<ptrdiff_t>(std::min(
                                                    kStretch, rollout.transitions.size() - first)));
      all.push_back(std::move(stretch));
    }
  }
  const auto kept = std::clamp<size_t>(static_cast<size_t>(count) / kStretch, 1, all.size());
  std::vector<Rollout> spread;
  for (size_t i = 0; i < kept; ++i) {
    spread.push_back(std::move(all[i * all.size() / kept]));
    auto& transitions = spread.back().transitions;
    if (static_cast<int64_t>(transitions.size()) > count)
      transitions.resize(static_cast<size_t>(count));
  }
  return spread;
}

BudgetedFit FitWithin(const RobotDescription& robot, const std::vector<Rollout>& rollouts,
                      int64_t budget, uint64_t seed, int threads) {
  const auto model = std::make_shared<const Model>(robot);
  CalibrationOptions options;
  options.seed = seed;
  options.execution = threads;
  auto count = std::min(static_cast<int64_t>(CountTransitions(rollouts)), budget / kCheapest);
  while (count >= kFewest) {
    const std::vector<Rollout> spread = SpreadTransitions(rollouts, count);
    const MethodResult result = RunMethod({model, spread, options, PriorGaussian(robot).mean});
    if (result.simulated_steps > budget) {
      count = std::min(count * 9 / 10, count * budget / result.simulated_steps);
      continue;
    }
    return {{0, robot.parameters, result.posterior},
            result.simulated_steps,
            static_cast<int64_t>(CountTransitions(spread))};
  }
  throw std::invalid_argument("a budget of " + std::to_string(budget) +
                              " simulated steps is not enough for a fit");
}

}  // namespace plumb
