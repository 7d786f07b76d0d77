#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "calibrator/fit/discrepancy.h"
#include "common/special_numbers.h"
#include "robot/residual.h"
#include "sim/model.h"

namespace plumb {

// Judge uses the discrepancy's threads, and that alone is not thread-safe.

/// Error of predicting n steps ahead on transitions that the fit has not seen, root mean square
/// over states and windows, in standard units (Task::state_scale).
struct HorizonError {
  int horizon;       ///< n
  int64_t windows;   ///< predicted; with 0 the errors are NaN
  double posterior;  ///< of the posterior's mean
  double prior;      ///< of the prior's mean
  /// of the posterior's mean with the residual of the transitions that were fitted; NaN where there
  /// is none
  double corrected = kNaN;
};

/// Discrepancy::ReplayError of the motion held out, of the posterior's and of the prior's mean.
struct ReplayErrors {
  double posterior = kNaN;
  double prior = kNaN;
  double seconds = 0;  ///< of the longest stretch
};

struct Holdout {
  int64_t fitted = 0, held_out = 0;  ///< transitions
  std::vector<HorizonError> errors;
  /// the posterior predicts better than the prior at some horizons, and at none worse, chance apart
  bool better = false;
  std::string summary;
  ReplayErrors replay = {};  ///< where it was asked for
};

/// Transitions to fit, and those kept back to judge the fit by.
struct Split {
  std::vector<Rollout> fitted, held_out;
};

/// Every fifth roll-out is held out; of fewer than five, the last fifth of each. What has fewer
/// than ten transitions cannot spare any: nothing is held out.
Split HoldOut(std::span<const Rollout> rollouts);

/// Errors of predicting 1, 2, 5, 10, 20 and 50 steps ahead. @param posterior, prior means, physical
/// units. @param replay play the motion open-loop, too.
Holdout Judge(Discrepancy& discrepancy, const Split& split, const Eigen::VectorXd& posterior,
              const Eigen::VectorXd& prior, bool replay = false);
/// Predicts with a residual, too, and says so. @param residual of split.fitted, for the posterior's
/// mean. @throws std::invalid_argument as CorrectedPredictionErrors.
void JudgeResidual(const std::shared_ptr<const Model>& model, const Residual& residual,
                   const Split& split, const Eigen::VectorXd& posterior, Holdout* holdout);

}  // namespace plumb
