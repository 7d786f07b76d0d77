#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "calibrator/diagnostics/identifiability.h"
#include "calibrator/fit/discrepancy.h"
#include "calibrator/fit/methods.h"
#include "calibrator/gap/gap.h"
#include "calibrator/inference/reps_search.h"
#include "calibrator/motion/transitions.h"
#include "common/gaussian.h"
#include "robot/description.h"

namespace plumb {

/// The goal of an update by relative-entropy policy search.
enum class Objective {
  /// R = ln p(transitions | xi) + ln prior(xi) - ln p_phi(xi), temperature >= min_temperature. With
  /// temperature 1 the weighted samples are exactly the Bayesian posterior's, so the distribution
  /// comes to rest there: it neither collapses nor forgets its prior where the data say nothing. A
  /// greater temperature (the KL bound) is a step on the geometric path from p_phi to the
  /// posterior.
  kPosterior,
  /// R = - step error of the newest roll-out, costs mapped to [0, 1], temperature >= 0.01: the
  /// paper's.
  kStep,
  /// R = - trajectory error of the newest roll-out (SimOpt eq. 5), costs mapped to [0, 1],
  /// temperature >= 0.01.
  kTrajectory,
};

/// Error of predicting n steps ahead with the mean parameters, in standard units.
struct PredictionErrors {
  int horizon;
  double before;  ///< distribution that had not seen the newest roll-out
  double after;   ///< distribution that has
  double prior;   ///< the prior
};

/// The outcome of one iteration.
struct CalibrationReport {
  int iteration = 0;
  /// D_KL(after || before) of their moments, summed over the updates [nat]
  double kl = 0;
  /// effective sample size of the last update; NaN = the method draws no samples
  double ess = 0;
  double temperature = 0;  ///< of the last update; 1 = Bayes' rule
  double discrepancy = 0;  ///< step error of the mean on the newest roll-out; 1 = down to the noise
  double prior_discrepancy = 0;
  Windows::Failures failures;  ///< simulations that failed, of all since the start of the process
  std::vector<PredictionErrors> errors;
  Identifiability identifiability;
  std::vector<std::string> warnings;  ///< of the method
  std::string alarm, gap;             ///< see SimOpt::State
};

/// States (q, v) of the robot for simulated episodes to begin with, kStarts of them, or none if no
/// roll-out has its beginning: half of them those in which the newest roll-outs have begun, half
/// evenly from all of their motion. Thread-safe.
std::vector<Eigen::VectorXd> Starts(std::span<const Rollout> rollouts);
inline constexpr size_t kStarts = 32;

/// The loop's inference: the distribution over simulators, from roll-outs that come iteration by
/// iteration.
///   auto, laplace, mixture   one update an iteration: the posterior given all roll-outs so far
///                            (RunMethod). Windows grow up to the robot's calibration horizons, or
///                            50 steps; the search begins at the present mean
///   reps                     some updates an iteration by step-based SimOpt (Cui & Hensel), a
///                            RepsSearch with Objective::kPosterior
///   simopt                   the same with Objective::kTrajectory
/// Random numbers are keyed by (seed, iteration, update), so an interrupted calibration resumes to
/// the same bits, with any number of threads. Not thread-safe; uses `threads` threads inside.
class SimOpt {
 public:
  /// An iteration's roll-outs and those before it that fit in so many: a run of days takes no more
  /// memory, and no more time for an update, than one of minutes.
  static constexpr size_t kMostTransitions = 20'000;

  /// Everything a resumed run needs, apart from the robot.
  struct State {
    int iteration = 0;   ///< completed iterations
    std::string method;  ///< that was asked for
    GaussianMixture distribution;
    /// method that gave the distribution, e.g. laplace where auto was asked for; "prior" = none yet
    std::string used = "prior";
    /// that its simulators lack; null = nothing, or nothing is known of it
    std::shared_ptr<const Residual> residual;
    bool explained = false;              ///< see ParameterDistribution
    Informed informed = Informed::kAll;  ///< which steps the parameters are learnt from
    /// Fisher information of the coordinates that the distribution rests on, n x n; empty = of a
    /// search, or nothing was recorded
    Eigen::MatrixXd information;
    /// what the model does not explain of what was recorded, empty = no alarm; and what was done
    /// about it, or why nothing was, or that nobody can tell: empty where the model explains it
    std::string alarm, gap;
    GaussianMixture before;  ///< distribution at the beginning of the running iteration
    /// of the running iteration, else of the last one; without a search its update counts all the
    /// same
    RepsState search;
    double kl = 0, ess = 0, temperature = 0;  ///< see CalibrationReport
    std::vector<std::string> warnings;        ///< of the last update
    /// the newest, of kMostTransitions together; an iteration's are added when it begins
    std::vector<Rollout> rollouts;
    int forgotten = 0;  ///< roll-outs before those, of which nothing but the distribution is left
    std::vector<int> rollouts_per_iteration;  ///< of all so far
  };

  /// By relative-entropy policy search.
  SimOpt(const RobotDescription& robot, uint64_t seed, int threads,
         Objective objective = Objective::kPosterior);
  /// By the method of that name. @throws std::invalid_argument naming the nearest if there is none.
  SimOpt(const RobotDescription& robot, uint64_t seed, int threads, const std::string& method);
  ~SimOpt();

  uint64_t seed() const { return seed_; }
  const std::string& method() const { return method_; }
  const State& state() const { return state_; }
  /// Takes up an earlier state. @throws std::invalid_argument if it is not of this robot, or of
  /// another method.
  void Resume(State state);

  /// Begins an iteration with the roll-outs of the newest policy. They may hold no usable
  /// transition: the iteration then goes by with what earlier ones have shown. @throws
  /// std::invalid_argument if one is running.
  void Begin(std::vector<Rollout> rollouts);
  bool running() const;
  /// One update. Data that cannot be used leave the distribution as it is. @return the report when
  /// it was the iteration's last.
  std::optional<CalibrationReport> Update();
  /// The report of the iteration completed last, e.g. after Resume; empty for the prior.
  std::optional<CalibrationReport> Report();

 private:
  void Forget(size_t fresh);
  void Search();
  RepsOptions SearchOptions() const;
  Eigen::VectorXd Evaluate(const Eigen::MatrixXd& samples);
  void Infer();
  void Keep(const std::string& why);
  GapFit RunFromWhereItIs() const;
  std::span<const Rollout> Newest() const;

  RobotDescription robot_;
  uint64_t seed_;
  int threads_;
  std::string method_;
  std::optional<Objective> objective_;  // of a search
  std::shared_ptr<const Model> model_;
  Gaussian prior_;
  State state_;
  Discrepancy discrepancy_;
  int64_t failures_ = 0;  // simulations of RunMethod that have failed
};

}  // namespace plumb
