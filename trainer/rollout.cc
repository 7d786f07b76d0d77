#include "trainer/rollout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace plumb {

/// One episode.
struct Rollout::Record {
  std::vector<float> observations, actions;
  std::vector<double> rewards;
  Eigen::VectorXf final_observation;
  double sum = 0;
  bool terminated = false;
  bool usable = false;
};

/// What one thread works with.
struct Rollout::Worker {
  std::unique_ptr<Simulation> simulation;
  kernels::Tape tape;
  Eigen::VectorXf observation, action;

  /// @return false if the episode must be dropped.
  bool Play(const GaussianPolicy& policy, const kernels::Network& network, const ParameterSampler& sample,
            bool explore, Random& random, Record& record);
};

bool Rollout::Worker::Play(const GaussianPolicy& policy, const kernels::Network& network,
                           const ParameterSampler& sample, bool explore, Random& random, Record& record) {
  try {
    simulation->Reset(sample(random), random);
  } catch (const std::invalid_argument&) {
    return false;
  }
  const Eigen::ArrayXf sd = policy.log_std().array().exp();
  const auto observe = [&] {
    simulation->Observe(observation);
    observation = policy.Normalize(observation);
    return observation.allFinite();
  };
  if (!observe()) return false;
  for (int step = 0; step < simulation->steps_per_episode() && !record.terminated; ++step) {
    tape.Forward(network, observation.data(), 1, action.data());
    if (explore) {
      for (Eigen::Index a = 0; a < action.size(); ++a)
        action[a] += sd[a] * static_cast<float>(random.Normal());
    }
    const Simulation::Outcome outcome = simulation->Step(action);
    record.observations.insert(record.observations.end(), observation.begin(), observation.end());
    record.actions.insert(record.actions.end(), action.begin(), action.end());
    record.rewards.push_back(outcome.reward);
    record.sum += outcome.reward;
    record.terminated = outcome.terminated;
    if (!std::isfinite(record.sum) || !action.allFinite() || !observe()) return false;
  }
  record.final_observation = observation;
  return true;
}

Rollout::Rollout(const SimulationFactory& make, const PolicyShape& shape, Workers& workers)
    : workers_(&workers), network_(shape.sizes()) {
  for (int i = 0; i < workers.size(); ++i) {
    state_.push_back(std::make_unique<Worker>(Worker{make(), kernels::Tape(shape.sizes(), 1),
                                                     Eigen::VectorXf(shape.observations),
                                                     Eigen::VectorXf(shape.actions)}));
  }
  time_limit_ = state_.front()->simulation->steps_per_episode();
}

Rollout::~Rollout() = default;

std::vector<Rollout::Record> Rollout::Run(const GaussianPolicy& policy, const ParameterSampler& sample,
                                          int first, int count, bool explore, uint64_t seed, uint32_t stream,
                                          uint32_t number) {
  network_.Set({policy.parameters.data(), static_cast<size_t>(policy.parameters.size())});
  std::vector<Record> records(static_cast<size_t>(count));
  workers_->Run(count, [&](int task, int worker) {
    Random random(seed, {stream, number, static_cast<uint32_t>(first + task)});
    Record& record = records[static_cast<size_t>(task)];
    record.usable =
        state_[static_cast<size_t>(worker)]->Play(policy, network_, sample, explore, random, record);
  });
  return records;
}

Batch Rollout::Collect(const GaussianPolicy& policy, const ParameterSampler& sample, int steps, uint64_t seed,
                       uint32_t stream, uint32_t number) {
  Batch batch;
  int played = 0;
  while (batch.size() < steps) {
    // As many episodes as are missing if they last as long as those so far: known before they are played, so
    // that the number of threads cannot matter.
    const double length =
        batch.episodes.empty() ? time_limit_ : 1. * batch.size() / static_cast<double>(batch.episodes.size());
    const int wanted = static_cast<int>(std::ceil((steps - batch.size()) / length));
    for (const Record& record : Run(policy, sample, played, wanted, true, seed, stream, number)) {
      if (!record.usable) {
        ++batch.dropped;
        continue;
      }
      const int begin = batch.size();
      batch.observations.insert(batch.observations.end(), record.observations.begin(),
                                record.observations.end());
      batch.actions.insert(batch.actions.end(), record.actions.begin(), record.actions.end());
      batch.rewards.insert(batch.rewards.end(), record.rewards.begin(), record.rewards.end());
      batch.final_observations.insert(batch.final_observations.end(), record.final_observation.begin(),
                                      record.final_observation.end());
      batch.episodes.push_back({begin, batch.size(), record.terminated, record.sum});
    }
    played += wanted;
    if (2 * batch.dropped > played && played >= 10) {
      throw std::runtime_error(fmt::format(
          "{} of {} simulated episodes were not finite or had impossible parameters: nothing to learn from",
          batch.dropped, played));
    }
  }
  return batch;
}

double Rollout::Evaluate(const GaussianPolicy& policy, const ParameterSampler& sample, int episodes,
                         uint64_t seed, uint32_t stream, uint32_t number) {
  double sum = 0;
  int usable = 0;
  for (const Record& record : Run(policy, sample, 0, episodes, false, seed, stream, number)) {
    if (!record.usable) continue;
    sum += record.sum;
    ++usable;
  }
  return usable > 0 ? sum / usable : std::numeric_limits<double>::quiet_NaN();
}

double Batch::MeanReturn() const {
  double sum = 0;
  for (const Episode& episode : episodes) sum += episode.sum;
  return sum / static_cast<double>(episodes.size());
}

}  // namespace plumb
