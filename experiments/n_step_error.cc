#include "experiments/n_step_error.h"

#include <algorithm>
#include <cmath>

#include "sim/simulator.h"
#include "sim/tasks/task.h"

namespace plumb {

Eigen::VectorXd NStepErrors(const RobotDescription& robot,
                            const ParameterDistribution& distribution,
                            const std::vector<Rollout>& rollouts, int horizon, int simulators,
                            int every, uint64_t seed) {
  Simulator simulator(robot);
  const Eigen::VectorXd scale = MakeTask(robot)->state_scale();
  const Eigen::Index n = robot.num_velocities();
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(horizon), count = squares;
  Random random(seed, {0x5e3});
  for (int i = 0; i < simulators; ++i) {
    simulator.SetParameters(distribution.Sample(random));
    for (const Rollout& rollout : rollouts) {
      const auto& transitions = rollout.transitions;
      for (size_t first = 0; first + static_cast<size_t>(horizon) <= transitions.size();
           first += static_cast<size_t>(every)) {
        simulator.SetState(transitions[first].q, transitions[first].v);
        for (int k = 0; k < horizon; ++k) {
          const Transition& transition = transitions[first + static_cast<size_t>(k)];
          simulator.Step(transition.efforts);
          double squared =
              ((simulator.q() - transition.next_q).array() / scale.head(n).array()).square().sum() +
              ((simulator.v() - transition.next_v).array() / scale.tail(n).array()).square().sum();
          const double most = kFailed * kFailed * 2 * static_cast<double>(n);
          squares(k) += std::isfinite(squared) ? std::min(squared, most) : most;
          count(k) += 2 * static_cast<double>(n);
        }
      }
    }
  }
  return (squares.array() / count.array()).sqrt();
}

}  // namespace plumb
