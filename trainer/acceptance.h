#pragma once

#include <cmath>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "controller/policy.h"
#include "controller/trial.h"
#include "robot/parameter_distribution.h"
#include "trainer/trainer.h"

namespace plumb {

/// Which of several policies a robot is to be run with: the incumbent, and challengers one after
/// the other, judged by what they return on the robot itself, and in simulators that were learnt
/// since, from their own motion among other. (A return in the simulator that a policy was trained
/// in tells nothing: those that exploit it look best there.)
///
/// What a trial of s steps would have returned over an episode of T steps is its sum and, unless it
/// fell,
///   late_rate L(lambda, T - s),   L(lambda, m) = (1 - e^(-lambda m)) / lambda,
/// lambda being the policy's probability of a fall per step. Of n trials with S steps and F falls
///   lambda ~ Gamma(1 + F, S_all / F_all + S),
/// the conjugate posterior where the prior is the exponential distribution with the mean of all
/// policies that this robot has tried, its own trials among them (empirical Bayes); zero where none
/// has fallen. What counts is the expectation over lambda, in closed form: how unsure lambda is
/// says nothing for or against a challenger that has been tried as long as the incumbent.
/// What trials say of a return scatters, falls apart, by kScatter of it or, where it is more, by
/// what returns of whole episodes scatter by; the mean of n by 1 / sqrt(n) of that. kScatter is
/// that of 29 trials of four hoppers without a fall, which begin alike, each against the mean of
/// ten whole episodes (docs/gap.md).
///
/// What a trial does not see are falls after it, and from other starts. Simulators that were learnt
/// since know of them: of too many, but of more where a policy does fall. Challenger and incumbent
/// are therefore compared by the difference of their returns as trials have it, and kSimulated of
/// the difference in simulation (docs/gap.md).
///
/// Where an episode may begin anywhere, as a pendulum's, a trial says more of where it began than
/// of the policy, and simulators, where both begin alike, say more. If what trials say scatters by
/// more than kBeginnings of itself by where they begin, the two differences are weighted by how
/// precise they are (inverse-variance weighting): that of trials by their scatter, that in
/// simulation by the scatter of its mean, and by 1 - kSimulated of itself, as simulators may be
/// wrong by that; or, where the two disagree by more than that and the scatter of trials explain,
/// by what is left (DerSimonian and Laird, Controlled Clinical Trials 7, 1986, of two studies with
/// the doubt given to one): trials that are bad beyond chance outweigh simulators that know no
/// difference.
/// Not thread-safe; the same bits for the same trials.
class Acceptance {
 public:
  /// @param steps_per_episode T >= 1
  explicit Acceptance(int steps_per_episode) : steps_(steps_per_episode) {}
  /// Goes on where another one stood. @param trials by policy.
  Acceptance(int steps_per_episode, std::map<int, std::vector<Trial>> trials, int incumbent)
      : steps_(steps_per_episode), incumbent_(incumbent), trials_(std::move(trials)) {}

  /// A policy's trial. @param iteration names the policy. The first one is the incumbent.
  void Add(int iteration, const Trial& trial);

  /// What both return in an episode of simulators that were learnt since the challenger's trial,
  /// means over those in which neither failed; NaN = they cannot say.
  struct Simulated {
    double challenger = 0, incumbent = 0;
    double difference_sd = 0;  ///< of the difference of the means, for the few simulators, >= 0
    /// @param challenger,incumbent returns in the same simulators from the same states, NaN where
    /// one failed
    /// @throws std::invalid_argument if these are not as many.
    static Simulated Of(std::span<const double> challenger, std::span<const double> incumbent);
  };

  /// What the challenger returns in one simulator from wherever an episode may begin, falls apart:
  /// as trials say, and in whole episodes. No mean (NaN) and no scatter where all fall.
  struct Beginnings {
    double mean = 0, trial_sd = 0;
    double whole_sd = 0;
    /// @param trials,whole as of Trainer::TrialReturns.
    static Beginnings Of(std::span<const double> trials, std::span<const double> whole);
    bool decide() const { return trial_sd > kBeginnings * std::abs(mean); }
  };

  /// How the latest challenger has done.
  struct Decision {
    int challenger = -1, incumbent = -1;  ///< iterations; the incumbent of before
    bool accepted = false, trusted = false;
    double probability = 0;  ///< that the challenger's expected return is more
    /// of an episode, means; with the probability NaN where there has been no trial
    double challenger_return = 0, incumbent_return = 0;
    Simulated simulated;  ///< NaN where nobody was asked
  };
  /// Makes the challenger the incumbent if it is better with probability kSure.
  /// @throws std::invalid_argument if it has had no trial.
  Decision Decide(int challenger, const Beginnings& beginnings, const Simulated& simulated);
  /// Makes it the incumbent whatever the trials say: where the model explains the robot, training
  /// on it is the better judge. It need not have had a trial.
  Decision Trust(int challenger, const Beginnings& beginnings);
  /// Trusts the challenger where the simulators that were learnt since explain the robot, else
  /// decides, with both policies' returns in kSimulators of them, those held out.
  /// @param trainer whose policy is the challenger. @param incumbent the incumbent's policy.
  /// @throws as Decide.
  Decision Choose(Trainer& trainer, const GaussianPolicy& incumbent, int challenger,
                  const ParameterDistribution& learnt);

  /// -1 = none yet.
  int incumbent() const { return incumbent_; }
  /// E of the return of an episode. @throws std::invalid_argument if it has had no trial.
  double MeanReturn(int iteration) const;
  const std::map<int, std::vector<Trial>>& trials() const { return trials_; }

  static constexpr double kSure = 0.75;
  static constexpr double kScatter = 0.008;
  static constexpr double kSimulated = 0.5;
  static constexpr double kBeginnings = 0.1;
  static constexpr int kSimulators = 60;  ///< that Simulated is to be of

 private:
  int longest_trial() const;  // [steps]; 0 without any
  double Better(int challenger, const Beginnings& beginnings, const Simulated& simulated) const;

  int steps_;
  int incumbent_ = -1;
  std::map<int, std::vector<Trial>> trials_;  // by policy
};

/// "policy 3 accepted (2951; incumbent 2: 1846; simulated 2700, 2100; better with 98 %)".
/// Thread-safe.
std::string Summary(const Acceptance::Decision& decision);

}  // namespace plumb
