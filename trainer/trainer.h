#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "controller/policy.h"
#include "robot/description.h"
#include "trainer/critic.h"
#include "trainer/evaluation.h"
#include "trainer/rollout.h"
#include "trainer/trpo.h"
#include "trainer/workers.h"

namespace plumb {

/// The settings of the paper where ours learn faster: batches, discounts and KL bound of its table,
/// value targets in units of return, the whole batch for Fisher's matrix; one start, as the paper
/// keeps its last policy and judges none. It does not say how long its critic is fitted; targets so
/// large need 20 passes, 10 leave one seed in ten behind. Thread-safe.
TrainingSettings PaperSettings(TrainingSettings settings);

/// A policy that was judged, the critic that goes with it, and what its normaliser follows.
struct JudgedPolicy {
  GaussianPolicy policy;
  CriticState critic;
  int64_t updates = 0;     ///< after which it stood
  double mean_return = 0;  ///< without exploration; NaN if no episode could be used
  ObservationMoments observations{};
};

/// All that training has learnt, as a checkpoint keeps it.
struct TrainerState {
  GaussianPolicy policy;
  CriticState critic;
  /// of all that was seen, if the policy's normaliser follows them
  ObservationMoments observations{};
  int64_t updates = 0;           ///< since the beginning
  int64_t steps = 0;             ///< simulated steps since the beginning, those not learnt from too
  int64_t dropped_episodes = 0;  ///< since the beginning
  std::optional<JudgedPolicy> best{};  ///< of those judged, until training returns to it
};

/// One update in numbers.
struct UpdateReport {
  Trpo::Step step;
  int batch = 0;  ///< steps it rests on
  int dropped_episodes = 0;
  double mean_return = 0;         ///< of all episodes played, undiscounted
  double explained_variance = 0;  ///< of the critic, before it was fitted to this batch
  double entropy = 0;             ///< of the policy after the update [nat]
  bool critic_fitted = false;     ///< false: the fit was not finite and has been undone
};

/// What an update did not do as it should, for people, a sentence each: none where all is well.
/// @param update its number. Thread-safe.
std::vector<std::string> UpdateWarnings(int64_t update, const UpdateReport& report);

/// Trains a policy in simulation: roll out, estimate advantages, step the policy, fit the critic.
/// Its random numbers are named by (seed, update, episode): the same bits for any number of threads
/// and ranks, and for a run that was interrupted and resumed. Not thread-safe itself.
class Trainer {
 public:
  /// @param make makes simulations: some for each thread, and one to ask for sizes.
  /// @param action_scale effort of action 1, per action.
  /// @param threads 0 = as many as the machine has.
  /// @param ranks must outlive this. All of them make the same trainer and call the same methods,
  /// in the same order.
  Trainer(const TrainingSettings& settings, const SimulationFactory& make,
          const Eigen::VectorXd& action_scale, uint64_t seed, int threads,
          const Ranks& ranks = Ranks::Alone());

  TrainerState state() const;
  /// @throws std::invalid_argument if it is another network's.
  void Restore(TrainerState state);
  /// Begins with another policy, before the first update, the only start; its normaliser counts as
  /// much as all batches of the settings. (As ten batches, what is seen moves it, and with it the
  /// policy, by more than any step's KL bound: returns fell by half.) @throws std::invalid_argument
  /// if its network is another's.
  void Start(const GaussianPolicy& policy);
  const GaussianPolicy& policy() const { return policy_; }
  int64_t updates() const { return updates_; }
  int64_t steps() const { return steps_; }
  int64_t dropped_episodes() const { return dropped_episodes_; }

  /// One update of policy and critic. Until the settings' `starts` are made, both are new after
  /// each `updates` of them: no start learns from another. @throws std::runtime_error if the
  /// simulations cannot be used, or if ranks have come to different results.
  UpdateReport Update(const ParameterSampler& sample);

  /// The same, of a policy that has been judged where that was due: what training with judgements,
  /// from which ReturnToBest chooses, is made of.
  UpdateReport UpdateJudged(const ParameterSampler& sample);

  /// Whether the policy should be judged before the next update: at first, then 16 times in the
  /// `updates` of the settings, and where the next update is of another start.
  bool JudgementDue() const;
  /// Plays the policy without exploration in 30 simulators, always the same and not those held out,
  /// and remembers it if it is the best so far: by the mean of all returns, or of the worst_share
  /// of them from which it learns.
  void Judge(const ParameterSampler& sample);
  /// TRPO's last policy is not its best. Judges it, too, and goes back to the best one with its
  /// critic and all that its normaliser has seen: with more, the next update would move it by more
  /// than any KL bound. What follows is judged anew. @return after how many updates it stood.
  int64_t ReturnToBest(const ParameterSampler& sample);
  /// Other simulators than those of the judgements so far: they are void.
  void ForgetBest() { best_.reset(); }

  /// The policy without exploration on simulators drawn anew. Changes nothing.
  Evaluation Evaluate(const ParameterSampler& sample, int episodes);
  /// The same on simulators and initial states that are always the same for a seed, so that
  /// policies can be compared.
  Evaluation EvaluateHeldOut(const ParameterSampler& sample, int episodes) {
    return plumb::Evaluate(HeldOutReturns(policy_, sample, episodes));
  }
  /// Of any policy: the returns themselves, NaN where an episode failed.
  std::vector<double> HeldOutReturns(const GaussianPolicy& policy, const ParameterSampler& sample,
                                     int episodes);
  /// What 40 trials of the policy in one simulator say of its return, from wherever the task lets
  /// an episode begin, always the same; NaN where an episode ended before the time limit.
  /// @param trial_steps of each, >= 1
  std::vector<double> TrialReturns(const SimulatorDraw& simulator, int trial_steps);

 private:
  bool starts_anew() const;
  void StartAnew();
  void CompareRanks() const;

  TrainingSettings settings_;
  uint64_t seed_;
  const Ranks* ranks_;
  Workers workers_;
  GaussianPolicy policy_;
  RolloutSampler rollout_;
  Trpo trpo_;
  Critic critic_;
  ObservationMoments observations_;
  int64_t updates_ = 0;
  int64_t steps_ = 0;
  int64_t dropped_episodes_ = 0;
  std::optional<JudgedPolicy> best_;
};

}  // namespace plumb
