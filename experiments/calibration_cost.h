#pragma once

#include <functional>
#include <string>
#include <vector>

#include "experiments/calibration_strategy.h"
#include "experiments/options.h"
#include "experiments/recording.h"
#include "experiments/results.h"

namespace plumb {

/// Transitions of the robot that a calibration is given.
std::vector<int> TransitionCounts(const ExperimentOptions& options);

/// What calibrating by a strategy costs. A policy trained on the prior moves a robot whose
/// parameters are drawn for each run; that motion is remembered until another task's or run's is
/// asked for. `progress` is told the share that is done; it may throw to break off. Not
/// thread-safe.
class CalibrationCost {
 public:
  /// Control steps after which errors are looked at.
  static constexpr int kHorizon = 10;

  explicit CalibrationCost(const ExperimentOptions& options) : options_(options) {}

  /// A row for each of TransitionCounts; one with 0 for the prior and the oracle, which need none:
  /// transitions, and the return on the robot of a policy that has gone on training on what they
  /// tell.
  Results::Rows Returns(const PaperTask& task, CalibrationStrategy strategy, int run,
                        const std::function<void(double)>& progress);
  /// A row for each update of a SimOpt, and for each budget of the default that is enough for a
  /// fit: simulated steps, and the error after kHorizon steps, standard units.
  Results::Rows Errors(const PaperTask& task, CalibrationStrategy strategy, int run,
                       const std::function<void(double)>& progress);

 private:
  struct Remembered {
    std::string of;
    RobotDataset recording;
  };

  void Remember(const PaperTask& task, int run, const std::function<void(double)>& progress);
  ParameterDistribution Calibrated(CalibrationStrategy strategy, int transitions, int run) const;
  double Trained(const ParameterDistribution& distribution, int run,
                 const std::function<void(double)>& progress);

  ExperimentOptions options_;
  Remembered now_;
};

}  // namespace plumb
