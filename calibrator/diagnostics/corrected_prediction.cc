#include "calibrator/diagnostics/corrected_prediction.h"

#include <algorithm>
#include <optional>

#include "calibrator/fit/recorded_window.h"
#include "calibrator/fit/step_errors.h"
#include "sim/correction.h"
#include "sim/tasks/task.h"

namespace plumb {
namespace {

std::shared_ptr<const Residual> MeanOf(const Residual& residual) {
  auto mean = std::make_shared<Residual>(residual);
  for (const Residual::Part& part : Residual::kParts) {
    std::optional<ResidualFunction>& function = mean.get()->*part.function;
    if (!function) continue;
    function->noise.setZero();
    function->unknown.setZero();
  }
  return mean;
}

}  // namespace

Eigen::VectorXd CorrectedPredictionErrors(const std::shared_ptr<const Model>& model,
                                          const Eigen::VectorXd& physical, const Residual& residual,
                                          std::span<const Rollout> rollouts,
                                          std::span<const int> horizons) {
  const Eigen::VectorXd scale = MakeTask(model->description())->state_scale();
  const auto longest = static_cast<size_t>(*std::max_element(horizons.begin(), horizons.end()));
  Simulator simulator(model);
  simulator.SetParameters(physical);
  Correction correction(*model, MeanOf(residual));
  Random random(0);  // of noise that there is none of
  correction.Begin(0, random);
  Eigen::ArrayXd squares = Eigen::ArrayXd::Zero(static_cast<Eigen::Index>(horizons.size())),
                 windows = squares;
  for (const Rollout& rollout : rollouts) {
    const auto& transitions = rollout.transitions;
    const auto follows = [&](size_t i) {
      return i > 0 && transitions[i - 1].step + 1 == transitions[i].step;
    };
    for (size_t start = 0; start < transitions.size(); ++start) {
      BeginTransition(rollout, start, &simulator);
      const size_t end = std::min(transitions.size(), start + longest);
      for (size_t i = start; i < end && (i == start || follows(i)); ++i) {
        const Transition& t = transitions[i];
        const Eigen::VectorXd effort = t.mean_effort(),
                              before = follows(i) ? transitions[i - 1].mean_effort() : effort;
        correction.BeginStep(simulator);
        simulator.Step(t.efforts);
        correction.EndStep(simulator, effort, before, t.duration());
        const auto* horizon = std::find(horizons.data(), horizons.data() + horizons.size(),
                                        static_cast<int>(i - start + 1));
        if (horizon == horizons.data() + horizons.size()) continue;
        if (!IsObserved(t)) continue;
        const Simulator::State reading = simulator.Reading();
        squares[horizon - horizons.data()] +=
            MeanSquaredError(model->space(), reading.q, reading.v, t, scale);
        ++windows[horizon - horizons.data()];
      }
    }
  }
  return (squares / windows).sqrt();  // 0 / 0 is NaN
}

}  // namespace plumb
