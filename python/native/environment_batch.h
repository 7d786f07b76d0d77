#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "python/native/groups.h"
#include "python/native/matrix.h"
#include "sim/environment.h"
#include "sim/simulator_lanes.h"
#include "trainer/workers.h"

namespace plumb::python {

/// Environments of one model that are stepped together: side by side in the lanes of several
/// threads. Each has the bits of its own Environment::Step, for any number of threads and
/// companions. Used by one thread at a time.
class EnvironmentBatch {
 public:
  /// All in the zero state, with the prior's means as parameters.
  /// @param count > 0. @param threads 0 = as many as the machine has cores.
  EnvironmentBatch(std::shared_ptr<const Model> model, int count, int threads);

  const Model& model() const { return *model_; }
  int count() const { return static_cast<int>(environments_.size()); }
  int threads() const { return workers_.size(); }
  int action_size() const { return environments_.front().action_size(); }
  int observation_size() const { return environments_.front().observation_size(); }

  /// @param parameters count x parameters, physical units.
  /// @throws std::invalid_argument, see Parameters::Apply, naming the environment; those before it
  /// have theirs.
  void SetParameters(const Eigen::Ref<const Matrix<double>>& parameters);
  /// Where an episode of that number begins, of `plumb sim` with that seed.
  /// @param numbers one for each environment. @param where those that begin; empty = all.
  void Reset(uint64_t seed, std::span<const uint32_t> numbers, std::span<const bool> where);
  /// @param q, v a row for each environment. @throws std::invalid_argument, see Environment.
  void SetState(const Eigen::Ref<const Matrix<double>>& q,
                const Eigen::Ref<const Matrix<double>>& v);
  /// One control period of all. @param actions count x action_size, finite.
  void Step(const float* actions);

  // As they are after the latest call; a row for each environment.
  const Matrix<float>& observations() const { return observations_; }
  const Matrix<double>& q() const { return q_; }
  const Matrix<double>& v() const { return v_; }
  // Of the latest Step.
  const std::vector<double>& rewards() const { return rewards_; }
  const std::vector<uint8_t>& terminated() const { return terminated_; }

 private:
  struct Worker {
    explicit Worker(std::shared_ptr<const Model> model) : lanes(std::move(model)) {}
    SimulatorLanes lanes;
    std::vector<Environment::Move> moves;
  };
  static std::vector<Worker> MakeWorkers(const std::shared_ptr<const Model>& model, int count);
  void Read(int i);

  std::shared_ptr<const Model> model_;
  Workers workers_;
  std::vector<Worker> state_;  // of each worker
  std::vector<Environment> environments_;
  Groups groups_;
  Matrix<float> observations_;
  Matrix<double> q_, v_;
  std::vector<double> rewards_;
  std::vector<uint8_t> terminated_;
};

}  // namespace plumb::python
