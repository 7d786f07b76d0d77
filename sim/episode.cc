#include "sim/episode.h"

#include <stdexcept>
#include <utility>

namespace plumb {
namespace {

// Second words of the random streams: where an episode begins, and what its actor draws.
constexpr uint32_t kStartStream = 0x53544152, kActorStream = 0x4143544f;  // "STAR", "ACTO"

}  // namespace

Actor NoAction(int action_size) {
  return [action_size](const Eigen::VectorXf&, Random&) {
    return Eigen::VectorXf::Zero(action_size).eval();
  };
}

Actor RandomActions(int action_size) {
  return [action_size](const Eigen::VectorXf&, Random& random) {
    Eigen::VectorXf action(action_size);
    for (float& a : action) a = static_cast<float>(random.Uniform(-1, 1));
    return action;
  };
}

Actor PlayActions(Eigen::MatrixXf actions) {
  return [actions = std::move(actions), step = Eigen::Index{0}](const Eigen::VectorXf&,
                                                                Random&) mutable {
    if (step == actions.rows()) return Eigen::VectorXf::Zero(actions.cols()).eval();
    return actions.row(step++).transpose().eval();
  };
}

Random EpisodeStart(uint64_t seed, uint32_t number) { return Random(seed, {number, kStartStream}); }

EpisodeSummary PlayEpisode(Environment& environment, const RobotDescription& robot,
                           const Actor& actor, uint64_t seed, uint32_t number,
                           const std::function<void(const SimulatedStep&)>& see,
                           const std::function<bool()>& stop) {
  const Task& task = environment.task();
  Random start = EpisodeStart(seed, number), random(seed, {number, kActorStream});
  environment.Reset(start);
  EpisodeSummary episode;
  Eigen::VectorXf observation(environment.observation_size());
  SimulatedStep step;
  step.action.resize(environment.action_size());
  const int limit = environment.steps_per_episode();
  do {
    environment.Observe(observation);
    const Eigen::VectorXf action = actor(observation, random);
    if (!action.allFinite()) throw std::runtime_error("the policy's action is not finite");
    step.time = static_cast<double>(episode.steps) * robot.task.period;
    step.q = environment.reading_q();
    step.v = environment.reading_v();
    step.true_q = environment.q();
    const StepResult result = environment.Step(action);
    for (int i = 0; i < environment.action_size(); ++i) {
      step.action[i] =
          environment.effort()[task.action_indices()[static_cast<size_t>(i)]] / task.action_unit(i);
    }
    ++episode.steps;
    episode.sum += result.reward;
    step.reward = result.reward;
    step.terminated = result.terminated;
    step.truncated = !result.terminated && episode.steps >= limit;
    see(step);
    if (result.terminated) {
      const bool finite = environment.q().allFinite() && environment.v().allFinite();
      episode.end = finite ? EpisodeSummary::End::kTerminated : EpisodeSummary::End::kNotFinite;
      return episode;
    }
    if (episode.steps < limit && stop()) {
      episode.end = EpisodeSummary::End::kInterrupted;
      return episode;
    }
  } while (episode.steps < limit);
  return episode;
}

}  // namespace plumb
