#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "experiments/calibration_strategy.h"
#include "experiments/real_system.h"
#include "trainer/trainer.h"

namespace plumb {

/// How SimOpt's loop is run: roll out, calibrate, train, judge.
struct LoopSettings {
  CalibrationStrategy strategy = CalibrationStrategy::kDefault;
  int iterations = 5;
  /// of the robot, at most; episodes follow each other until there are as many
  int steps_per_iteration = 750;
  /// TRPO updates of the first policy and of each later one
  int first_updates = 0, next_updates = 0;
  /// of an iteration's steps, the first so many try the policy, without exploration, in as many
  /// episodes as it takes; 0 = none
  double trial_share = 0;
  /// What the simulators lack is looked for, where the robot's file asks for it.
  bool residual = true;
  /// Random forces that are trained with, as shares of the effort limits; 0 = none.
  double forces = 0;
  /// Factor of the posterior's covariance: a likelihood to the power of 1 / factor.
  double tempering = 1;
  /// Only what does better on the robot is deployed there, once its model has been found wrong;
  /// needs trials.
  bool accept = false;
  /// on the robot, without exploration: they judge, and nobody learns from them
  int evaluation_episodes = 20;
  uint64_t seed = 1;
  int threads = 0;
};

/// Iteration 0 is the policy before the robot has been used.
struct LoopRow {
  int iteration;
  double robot_return;       ///< of the deployed policy: mean without exploration
  double worst_return;       ///< its worst episode
  double newest_return;      ///< mean of the newest policy, which may not be deployed
  int deployed;              ///< the iteration whose policy that is
  double simulated_return;   ///< the same on simulators of the distribution that it was trained on
  double discrepancy;        ///< see CalibrationReport; NaN where nothing is learnt
  bool residual;             ///< a residual is trained with
  int64_t transitions;       ///< of the robot so far
  double robot_seconds;      ///< likewise
  Eigen::VectorXd mean, sd;  ///< of the parameters, physical units
};

struct LoopResult {
  std::vector<LoopRow> rows;
  std::vector<Rollout> rollouts;       ///< that were calibrated with
  std::vector<std::string> decisions;  ///< which policy was deployed, and why, with acceptance
};

/// Runs the loop, one strategy after the other. The first policy of a distribution is trained once
/// for all strategies that begin with it.
class Loop {
 public:
  /// @param model what is calibrated and trained in. @param truth physical units, for the oracle;
  /// empty if there is none.
  Loop(RobotDescription model, Eigen::VectorXd truth);

  /// @param real used for roll-outs and judgement. @param progress told the share that is done; may
  /// throw to break off.
  LoopResult Run(RealSystem& real, const LoopSettings& settings,
                 const std::function<void(double)>& progress);

  /// Returns without exploration.
  struct Judgement {
    double mean, worst;
  };
  static Judgement Judge(RealSystem& real, const GaussianPolicy& policy, int steps, int episodes);

  /// A trainer that has made so many updates on a distribution; from the one that made them before,
  /// if any.
  std::unique_ptr<Trainer> TrainFirst(const std::string& name,
                                      const ParameterDistribution& distribution,
                                      const LoopSettings& settings,
                                      const std::function<void(double)>& progress);

  /// So many updates; the policy is then the best that was judged, as in plumb-trainer.
  static void Train(Trainer& trainer, const ParameterSampler& sample, int updates,
                    const std::function<void(double)>& progress);

  const RobotDescription& model() const { return model_; }

 private:
  class Running;

  std::unique_ptr<Trainer> MakeTrainer(const LoopSettings& settings) const;

  RobotDescription model_;
  Eigen::VectorXd truth_;
  std::map<std::string, TrainerState> first_;  // by distribution, seed and updates
};

}  // namespace plumb
