#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "python/native/groups.h"
#include "python/native/matrix.h"
#include "robot/parameter_distribution.h"
#include "trainer/rollout.h"
#include "trainer/workers.h"

namespace plumb::python {

/// Episodes of a task as the trainer sees them, one after the other in each of many simulations: an
/// episode draws its simulator of a distribution. Random numbers are named by seed, episode and
/// simulation: the same for any number of threads; the first episodes are those of
/// a policy's evaluation on kHeldOutStream. Used by one thread at a time.
class TaskBatch {
 public:
  /// @param count > 0. @param threads 0 = as many as the machine has cores.
  /// @throws std::invalid_argument, see SimulateRobot.
  TaskBatch(const RobotDescription& robot, ParameterDistribution distribution, int count,
            int threads);

  int count() const { return static_cast<int>(simulations_.size()); }
  int threads() const { return workers_.size(); }
  int action_size() const { return action_size_; }

  /// Begins episode 0 of that seed in all.
  /// @throws std::runtime_error if the distribution has no simulators.
  void Reset(uint64_t seed);
  /// One control period of all, but for those whose episode is over: they begin the next.
  /// @param actions count x action_size, finite.
  void Step(const float* actions);
  /// The next episode at once where one is over; what it ended with is in final_observations.
  void BeginWhereOver();

  // A row or an entry for each simulation, as it is after the latest call.
  Matrix<float> observations, final_observations;
  std::vector<double> rewards, returns;  ///< of the step; of the episode so far
  std::vector<int64_t> lengths;          ///< steps of the episode so far
  std::vector<uint8_t> terminated, truncated;
  /// Episodes cut off as the simulation has blown up: the reward is 0, the observation the last one
  /// that was finite.
  std::vector<uint8_t> failed;

 private:
  struct Episode {
    uint32_t next = 0;  // number of the one that comes after it
    int64_t steps = 0;
    double sum = 0;  // of its rewards
    bool over = false;
  };
  void Begin(size_t i);
  void Finish(size_t i, const StepResult& result);
  void Tell(size_t i, double reward, bool by_task, bool by_time, bool by_failure);

  ParameterDistribution distribution_;
  Workers workers_;
  std::vector<std::unique_ptr<Simulation>> simulations_;
  std::vector<std::vector<Simulation::Move>> moves_;  // of each worker
  std::vector<Episode> episodes_;
  Groups groups_;
  uint64_t seed_ = 0;
  int action_size_, time_limit_;
};

}  // namespace plumb::python
