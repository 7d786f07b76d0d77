#include "python/native/environment_batch.h"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

#include "sim/episode.h"

namespace plumb::python {

std::vector<EnvironmentBatch::Worker> EnvironmentBatch::MakeWorkers(
    const std::shared_ptr<const Model>& model, int count) {
  std::vector<Worker> workers;
  workers.reserve(static_cast<size_t>(count));
  for (int i = 0; i < count; ++i) workers.emplace_back(model);
  return workers;
}

EnvironmentBatch::EnvironmentBatch(std::shared_ptr<const Model> model, int count, int threads)
    : model_(std::move(model)),
      workers_(threads),
      state_(MakeWorkers(model_, workers_.size())),
      groups_(count, state_.front().lanes.count(), workers_),
      rewards_(count),
      terminated_(count) {
  environments_.reserve(static_cast<size_t>(count));
  for (int i = 0; i < count; ++i) environments_.emplace_back(model_);
  observations_.resize(count, observation_size());
  q_.resize(count, model_->num_positions());
  v_.resize(count, model_->num_velocities());
  for (int i = 0; i < count; ++i) Read(i);
}

void EnvironmentBatch::SetParameters(const Eigen::Ref<const Matrix<double>>& parameters) {
  groups_.Run([&](int first, int last, int) {
    for (int i = first; i < last; ++i) {
      try {
        environments_[static_cast<size_t>(i)].SetParameters(parameters.row(i).transpose());
      } catch (const std::invalid_argument& error) {
        throw std::invalid_argument(fmt::format("parameters: row {}: {}", i, error.what()));
      }
    }
  });
}

void EnvironmentBatch::Reset(uint64_t seed, std::span<const uint32_t> numbers,
                             std::span<const bool> where) {
  groups_.Run([&](int first, int last, int) {
    for (int i = first; i < last; ++i) {
      const auto at = static_cast<size_t>(i);
      if (!where.empty() && !where[at]) continue;
      Random random = EpisodeStart(seed, numbers[at]);
      environments_[at].Reset(random);
      rewards_[at] = 0, terminated_[at] = 0;
      Read(i);
    }
  });
}

void EnvironmentBatch::SetState(const Eigen::Ref<const Matrix<double>>& q,
                                const Eigen::Ref<const Matrix<double>>& v) {
  groups_.Run([&](int first, int last, int) {
    for (int i = first; i < last; ++i) {
      const auto at = static_cast<size_t>(i);
      environments_[at].SetState(q.row(i).transpose(), v.row(i).transpose());
      rewards_[at] = 0, terminated_[at] = 0;
      Read(i);
    }
  });
}

void EnvironmentBatch::Step(const float* actions) {
  const int size = action_size();
  groups_.Run([&](int first, int last, int worker_number) {
    Worker& worker = state_[static_cast<size_t>(worker_number)];
    worker.moves.clear();
    for (int i = first; i < last; ++i) {
      worker.moves.push_back(
          {&environments_[static_cast<size_t>(i)], {actions + ptrdiff_t{i} * size, size}});
    }
    Environment::Step(worker.moves, worker.lanes);
    for (int i = first; i < last; ++i) {
      const StepResult& result = worker.moves[static_cast<size_t>(i - first)].result;
      rewards_[static_cast<size_t>(i)] = result.reward;
      terminated_[static_cast<size_t>(i)] = result.terminated;
      Read(i);
    }
  });
}

void EnvironmentBatch::Read(int i) {
  const Environment& environment = environments_[static_cast<size_t>(i)];
  environment.Observe(observations_.row(i).transpose());
  q_.row(i) = environment.q().transpose();
  v_.row(i) = environment.v().transpose();
}

}  // namespace plumb::python
