#include "experiments/n_step_error.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "sim/tasks/task.h"
#include "sim/windows.h"

namespace plumb {

Eigen::VectorXd NStepErrors(const RobotDescription& robot,
                            const ParameterDistribution& distribution,
                            const std::vector<Rollout>& rollouts, int horizon, int simulators,
                            int every, uint64_t seed) {
  const Eigen::VectorXd scale = MakeTask(robot)->state_scale();
  const Eigen::Index n = robot.num_velocities();
  std::vector<Window> windows;
  std::vector<std::span<const Transition>> truths;
  for (const Rollout& rollout : rollouts) {
    const std::span<const Transition> all = rollout.transitions;
    for (size_t first = 0; first + static_cast<size_t>(horizon) <= all.size();
         first += static_cast<size_t>(every)) {
      truths.push_back(all.subspan(first, static_cast<size_t>(horizon)));
      windows.push_back({all[first].q, all[first].v, {}});
      for (const Transition& transition : truths.back())
        windows.back().steps.emplace_back(transition.efforts);
    }
  }
  Random random(seed, {0x5e3});
  Eigen::MatrixXd parameters(static_cast<Eigen::Index>(robot.parameters.size()), simulators);
  for (auto sample : parameters.colwise()) sample = distribution.Sample(random);
  // [step][window], sample after sample: summed in this order, whatever is simulated side by side.
  const auto width = static_cast<Eigen::Index>(windows.size());
  Eigen::MatrixXd squared(horizon, width * simulators);
  const double most = kFailed * kFailed * 2 * static_cast<double>(n);
  Windows simulate(std::make_shared<const Model>(robot), 1);
  simulate.Predict(
      parameters, windows,
      [&](Eigen::Index sample, size_t window, size_t step, const Eigen::VectorXd& q,
          const Eigen::VectorXd& v) {
        const Transition& truth = truths[window][step];
        const double sum = ((q - truth.next_q).array() / scale.head(n).array()).square().sum() +
                           ((v - truth.next_v).array() / scale.tail(n).array()).square().sum();
        squared(static_cast<Eigen::Index>(step),
                sample * width + static_cast<Eigen::Index>(window)) =
            std::isfinite(sum) ? std::min(sum, most) : most;
      },
      false);
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(horizon);
  for (const auto& errors : squared.colwise()) squares += errors;
  return (squares / (2. * static_cast<double>(n * squared.cols()))).cwiseSqrt();
}

}  // namespace plumb
