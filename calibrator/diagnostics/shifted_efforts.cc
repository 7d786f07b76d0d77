#include "calibrator/diagnostics/shifted_efforts.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "calibrator/fit/curriculum.h"

namespace plumb {
namespace {

constexpr size_t kMostSteps = 500, kFewestSteps = 20;
// Share of what a velocity changes by in a step, root mean square.
constexpr double kMuch = 0.1;

// Efforts of another row make errors as large as what efforts do.
bool MayBeShifted(std::span<const Rollout> rollouts, const Eigen::ArrayXd& velocity_noise) {
  Eigen::ArrayXd squares = Eigen::ArrayXd::Zero(velocity_noise.size()), count = squares;
  for (const Rollout& rollout : rollouts) {
    for (const Transition& t : rollout.transitions) {
      const Eigen::ArrayXd change = (t.next_v - t.v).array().square();
      squares += change.isFinite().select(change, 0);
      count += change.isFinite().cast<double>();
    }
  }
  return (velocity_noise.square() > kMuch * kMuch * squares / count.max(1)).any();
}

// Those that have both neighbours, each with the efforts of the step so many rows after.
std::vector<Rollout> WithEffortsOf(std::span<const Rollout> rollouts, int rows) {
  std::vector<Rollout> shifted;
  size_t count = 0;
  for (const Rollout& rollout : rollouts) {
    const std::vector<Transition>& t = rollout.transitions;
    shifted.push_back({rollout.episode, rollout.policy_iteration, {}});
    for (size_t k = 1; k + 1 < t.size() && count < kMostSteps; ++k) {
      if (t[k].step != t[k - 1].step + 1 || t[k + 1].step != t[k].step + 1) continue;
      const size_t from = rows > 0 ? k + 1 : rows < 0 ? k - 1 : k;
      Transition step = t[k];
      step.efforts = t[from].efforts;
      for (EffortSegment& held : step.efforts)
        held.duration *= t[k].duration() / t[from].duration();
      shifted.back().transitions.push_back(std::move(step));
      ++count;
    }
  }
  return shifted;
}

// Of the errors of one step, velocities alone; physical units.
std::optional<Eigen::ArrayXd> Variances(const std::shared_ptr<const Model>& model,
                                        std::span<const Rollout> rollouts,
                                        ExecutionOptions execution, int64_t* simulated_steps) {
  CurriculumOptions options;
  options.horizons = {1}, options.starts = 1, options.execution = execution;
  try {
    const CurriculumFit fit = FitCurriculum(model, rollouts, options);
    *simulated_steps += fit.simulated_steps;
    return fit.noise_sd.tail(model->description().num_velocities()).array().square().eval();
  } catch (const std::invalid_argument&) {
    return std::nullopt;
  }
}

}  // namespace

EffortShift FindEffortShift(const std::shared_ptr<const Model>& model,
                            std::span<const Rollout> rollouts, const Eigen::VectorXd& noise_sd,
                            ExecutionOptions execution, int64_t* simulated_steps) {
  EffortShift found;
  if (!MayBeShifted(rollouts, noise_sd.tail(model->description().num_velocities()))) return found;
  const std::vector<Rollout> own = WithEffortsOf(rollouts, 0);
  if (CountTransitions(own) < kFewestSteps) return found;
  const auto as_recorded = Variances(model, own, execution, simulated_steps);
  if (!as_recorded) return found;
  for (const int rows : {1, -1}) {
    const auto variances =
        Variances(model, WithEffortsOf(rollouts, rows), execution, simulated_steps);
    if (!variances) continue;
    // Joints differ in size, and one that another row's efforts do not explain counts against them.
    const double left = (*variances / *as_recorded).mean();
    if (left < std::min(kClearlyShifted, found.left)) found = {rows, left};
  }
  return found;
}

std::string DescribeShift(const EffortShift& shift) {
  if (shift.rows == 0) return {};
  return fmt::format(
      "efforts stand in the wrong rows: with those of the row {} each, {:.0f} % of the velocities' "
      "squared errors would be left; nothing that is learnt with them as they stand is right",
      shift.rows > 0 ? "after" : "before", 100 * shift.left);
}

}  // namespace plumb
