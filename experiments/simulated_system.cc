#include "experiments/simulated_system.h"

#include <algorithm>
#include <cmath>
#include <span>

namespace plumb {
namespace {

constexpr uint32_t kTrial = 0x7121a1;  // first stream word

Eigen::VectorXd Noisy(const Eigen::VectorXd& x, const Eigen::VectorXd& sd, Random& random) {
  Eigen::VectorXd read = x;
  for (Eigen::Index i = 0; i < x.size(); ++i) read(i) += sd(i) * random.Normal();
  return read;
}

}  // namespace

SimulatedSystem::SimulatedSystem(const RobotDescription& robot, const Eigen::VectorXd& hidden,
                                 const Eigen::VectorXd& noise, uint64_t seed)
    : environment_(robot),
      q_sd_(noise.head(robot.num_velocities())),
      v_sd_(noise.tail(robot.num_velocities())),
      period_(robot.task.period),
      latency_(std::clamp(robot.simulation.latency, 0.0, period_)),
      seed_(seed) {
  environment_.SetParameters(hidden);
}

RobotEpisode SimulatedSystem::Run(const GaussianPolicy& policy, bool explore, int steps,
                                  uint32_t number) {
  Random random(seed_, {kTrial, number, explore ? 1u : 0u});
  environment_.Reset(random);
  RobotEpisode episode;
  episode.rollout.episode = number;
  Eigen::VectorXf observation(environment_.observation_size());
  Eigen::VectorXd q = Noisy(environment_.q(), q_sd_, random),
                  v = Noisy(environment_.v(), v_sd_, random);
  const int limit = std::min(steps, environment_.steps_per_episode());
  for (int step = 0; step < limit; ++step) {
    Transition transition;
    transition.step = step;
    transition.q = q, transition.v = v;
    transition.q_sd = transition.next_q_sd = q_sd_;
    transition.v_sd = transition.next_v_sd = v_sd_;
    if (latency_ > 0) transition.efforts.push_back({latency_, environment_.effort()});
    environment_.task().Observe(
        q, v, std::span(observation.data(), static_cast<size_t>(observation.size())));
    const StepResult result =
        environment_.Step(explore ? policy.Sample(observation, random) : policy.Mean(observation));
    transition.efforts.push_back({period_ - latency_, environment_.effort()});
    q = Noisy(environment_.q(), q_sd_, random), v = Noisy(environment_.v(), v_sd_, random);
    if (!q.allFinite() || !v.allFinite()) break;
    transition.next_q = q, transition.next_v = v;
    episode.rollout.transitions.push_back(std::move(transition));
    episode.sum_of_rewards += result.reward;
    episode.trial.Add(result.reward, limit);
    episode.seconds += period_;
    episode.trial.fell = result.terminated;
    if (result.terminated) break;
  }
  return episode;
}

Eigen::VectorXd ReadingNoise(const RobotDescription& robot) {
  constexpr double kPosition = 2 * M_PI / 16384 / 3.4641016151377544, kVelocity = 5e-3;  // sqrt(12)
  Eigen::VectorXd noise(2 * robot.num_velocities());
  noise << Eigen::VectorXd::Constant(robot.num_velocities(), kPosition),
      Eigen::VectorXd::Constant(robot.num_velocities(), kVelocity);
  return noise;
}

}  // namespace plumb
