#include "python/native/task_batch.h"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "trainer/robot_simulation.h"
#include "trainer/streams.h"

namespace plumb::python {
namespace {

constexpr int kLanes = 8;    // at most: SimulatorLanes::count
constexpr int kTries = 100;  // draws of which there is no simulator, one after the other

}  // namespace

TaskBatch::TaskBatch(const RobotDescription& robot, ParameterDistribution distribution, int count,
                     int threads)
    : rewards(count),
      returns(count),
      lengths(count),
      terminated(count),
      truncated(count),
      failed(count),
      distribution_(std::move(distribution)),
      workers_(threads),
      moves_(static_cast<size_t>(workers_.size())),
      episodes_(count),
      groups_(count, kLanes, workers_) {
  const SimulationFactory make = SimulateRobot(robot);
  for (int i = 0; i < count; ++i) simulations_.push_back(make());
  const Simulation& any = *simulations_.front();
  action_size_ = any.action_size(), time_limit_ = any.steps_per_episode();
  observations.setZero(count, any.observation_size());
  final_observations = observations;
}

void TaskBatch::Reset(uint64_t seed) {
  seed_ = seed;
  groups_.Run([&](int first, int last, int) {
    for (auto i = static_cast<size_t>(first); i < static_cast<size_t>(last); ++i) {
      episodes_[i].next = 0;
      Begin(i);
      Tell(i, 0, false, false, false);
    }
  });
}

void TaskBatch::Begin(size_t i) {
  const uint32_t number = episodes_[i].next;
  Random random(seed_, {kHeldOutStream, number, static_cast<uint32_t>(i)});
  for (int tries = 0;; ++tries) {
    try {
      simulations_[i]->Reset(distribution_.Draw(random), random);
      break;
    } catch (const std::invalid_argument& error) {
      if (tries == kTries)
        throw std::runtime_error(std::string("distribution: has no simulators: ") + error.what());
    }
  }
  simulations_[i]->Observe(observations.row(static_cast<Eigen::Index>(i)).transpose());
  episodes_[i] = {number + 1, 0, 0, false};
}

void TaskBatch::Step(const float* actions) {
  groups_.Run([&](int first, int last, int worker) {
    std::vector<Simulation::Move>& moves = moves_[static_cast<size_t>(worker)];
    moves.clear();
    for (int i = first; i < last; ++i) {
      if (episodes_[static_cast<size_t>(i)].over) continue;
      moves.push_back({simulations_[static_cast<size_t>(i)].get(),
                       {actions + ptrdiff_t{i} * action_size_, action_size_}});
    }
    if (!moves.empty()) simulations_[static_cast<size_t>(first)]->StepTogether(moves);
    auto move = moves.begin();
    for (auto i = static_cast<size_t>(first); i < static_cast<size_t>(last); ++i) {
      if (episodes_[i].over) {
        Begin(i);
        Tell(i, 0, false, false, false);
      } else {
        Finish(i, (move++)->result);
      }
    }
  });
}

void TaskBatch::Finish(size_t i, const StepResult& result) {
  auto observation = observations.row(static_cast<Eigen::Index>(i)).transpose();
  const Eigen::VectorXf before = observation;
  simulations_[i]->Observe(observation);
  const bool blown_up = !std::isfinite(result.reward) || !observation.allFinite();
  if (blown_up) observation = before;
  const double reward = blown_up ? 0 : result.reward;
  Episode& episode = episodes_[i];
  ++episode.steps, episode.sum += reward;
  const bool by_task = result.terminated && !blown_up;
  Tell(i, reward, by_task, !by_task && (blown_up || episode.steps >= time_limit_), blown_up);
  episode.over = terminated[i] || truncated[i];
}

void TaskBatch::Tell(size_t i, double reward, bool by_task, bool by_time, bool by_failure) {
  rewards[i] = reward, returns[i] = episodes_[i].sum, lengths[i] = episodes_[i].steps;
  terminated[i] = by_task, truncated[i] = by_time, failed[i] = by_failure;
}

void TaskBatch::BeginWhereOver() {
  groups_.Run([&](int first, int last, int) {
    for (auto i = static_cast<size_t>(first); i < static_cast<size_t>(last); ++i) {
      if (!episodes_[i].over) continue;
      const auto row = static_cast<Eigen::Index>(i);
      final_observations.row(row) = observations.row(row);
      Begin(i);
    }
  });
}

}  // namespace plumb::python
