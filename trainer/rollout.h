#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "common/random.h"
#include "controller/policy.h"
#include "robot/parameter_distribution.h"
#include "sim/environment.h"
#include "trainer/episode_record.h"
#include "trainer/gae.h"
#include "trainer/kernels/network.h"
#include "trainer/moments.h"
#include "trainer/workers.h"

namespace plumb {

/// A simulated task as the trainer sees it: reset, observe, step. Used by one thread at a time.
class Simulation {
 public:
  virtual ~Simulation() = default;
  virtual int observation_size() const = 0;
  virtual int action_size() const = 0;
  /// Time limit of an episode.
  virtual int steps_per_episode() const = 0;
  /// Becomes this simulator, in a random initial state.
  /// @throws std::invalid_argument if there is no such simulator.
  virtual void Reset(const SimulatorDraw& simulator, Random& random) = 0;
  virtual void Observe(Eigen::Ref<Eigen::VectorXf> observation) const = 0;
  /// @param action policy units; clipped by the simulation.
  virtual StepResult Step(const Eigen::Ref<const Eigen::VectorXf>& action) = 0;

  /// One simulation's part in a step of several.
  struct Move {
    Simulation* simulation;
    Eigen::Map<const Eigen::VectorXf> action;
    StepResult result{};  ///< is written
  };
  /// Steps several that the same factory has made, itself perhaps among them: with the results of
  /// Step, but perhaps sooner. One after the other unless a simulation knows better.
  virtual void StepTogether(std::span<Move> moves) {
    for (Move& move : moves) move.result = move.simulation->Step(move.action);
  }
};

using SimulationFactory = std::function<std::unique_ptr<Simulation>()>;
/// Draws a simulator.
using ParameterSampler = std::function<SimulatorDraw(Random&)>;

/// Complete episodes, one after the other.
struct Batch {
  std::vector<float> observations;  ///< as the network sees them (normalised), observations x N
  std::vector<float> actions;       ///< as drawn, before clipping, actions x N
  std::vector<double> rewards;      ///< N
  std::vector<EpisodeSpan> episodes;
  /// after the last step (before any reset), observations x episodes
  std::vector<float> final_observations;
  /// of the observations as the task gives them, of all episodes played
  ObservationMoments moments;
  int played = 0;  ///< episodes, also those that were too good to be learnt from
  /// episodes thrown away because something was not finite, or the simulator impossible
  int dropped = 0;
  int64_t steps = 0;       ///< of all episodes played, but for those dropped
  double mean_return = 0;  ///< of all episodes played, but for those dropped

  int size() const { return static_cast<int>(rewards.size()); }
};

/// Rolls a policy out in simulators drawn one per episode. Ranks and threads share the episodes; a
/// thread plays several side by side, so that the network is evaluated for all of them at once.
/// Random numbers are named by seed, stream and episode: the batch is the same for any number of
/// threads and ranks, and every rank gets all of it. Not thread-safe itself.
class RolloutSampler {
 public:
  /// @param make called several times per worker. @param workers,ranks must outlive this.
  RolloutSampler(const SimulationFactory& make, const PolicyShape& shape, Workers& workers,
                 const Ranks& ranks = Ranks::Alone());
  ~RolloutSampler();

  /// Whole episodes of at least `steps` steps together.
  /// @param worst_share of the episodes, those of lowest return, are kept: what is learnt from them
  /// guards against the worst simulators of the distribution (Rajeswaran et al., "EPOpt", ICLR
  /// 2017). 1 = all.
  /// @param stream,number name the random numbers, together with the episode's number.
  /// @throws std::runtime_error if most episodes have to be dropped.
  Batch Collect(const GaussianPolicy& policy, const ParameterSampler& sample, int steps,
                double worst_share, uint64_t seed, uint32_t stream, uint32_t number);
  /// Return of the mean action's policy in each of some episodes; NaN where something was not
  /// finite.
  std::vector<double> Returns(const GaussianPolicy& policy, const ParameterSampler& sample,
                              int episodes, uint64_t seed, uint32_t stream, uint32_t number);
  /// What trials of so many steps say of the same (Trial::WholeReturn); NaN where an episode ended
  /// before the time limit, too. @param trial_steps >= 1; more than an episode has are all of it
  std::vector<double> TrialReturns(const GaussianPolicy& policy, const ParameterSampler& sample,
                                   int trial_steps, int episodes, uint64_t seed, uint32_t stream,
                                   uint32_t number);

 private:
  struct Player;
  struct Worker;
  /// The episodes [first, first + count), shared out among ranks and threads.
  std::vector<EpisodeRecord> Run(const GaussianPolicy& policy, const ParameterSampler& sample,
                                 int first, int count, bool explore, uint64_t seed, uint32_t stream,
                                 uint32_t number);

  Workers* workers_;
  const Ranks* ranks_;
  kernels::Network network_;
  std::vector<std::unique_ptr<Worker>> state_;  // one per worker
  int time_limit_;
};

}  // namespace plumb
