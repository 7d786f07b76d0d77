#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "calibrator/diagnostics/holdout.h"
#include "calibrator/diagnostics/identifiability.h"
#include "calibrator/diagnostics/log_agreement.h"
#include "calibrator/diagnostics/misspecification.h"
#include "calibrator/diagnostics/shifted_efforts.h"
#include "calibrator/fit/curriculum.h"
#include "calibrator/fit/window_errors.h"
#include "calibrator/gap/gap.h"
#include "common/gaussian.h"

namespace plumb {

/// The update of the loop that findings come from.
struct LoopUpdate {
  int iteration;       ///< of the distribution; it has seen the roll-outs of earlier policies
  int64_t utime;       ///< [us] start of the newest roll-out
  double kl;           ///< D_KL(after || before) of the moments, summed over the updates [nat]
  double ess;          ///< effective sample size of the last update; NaN = draws no samples
  double temperature;  ///< of the last update; 1 = Bayes' rule
  bool explained;      ///< see ParameterDistribution
  Informed informed;   ///< which steps the parameters are learnt from
  /// what the model does not explain, and what was done about it, see SimOpt::State
  std::string alarm, gap;
};

/// All that a calibration has found. Plain data: not thread-safe.
struct Findings {
  std::string method;  ///< that was asked for
  std::string used;    ///< that gave the answer, e.g. "laplace" where "auto" was asked for
  uint64_t seed = 0;
  Gaussian prior;             ///< coordinates
  GaussianMixture posterior;  ///< coordinates
  Eigen::MatrixXd samples;    ///< of the posterior, physical units, n x N, equally weighted
  int64_t transitions = 0;
  int64_t simulated_steps = 0;   ///< transitions simulated for the fit
  int64_t diagnostic_steps = 0;  ///< and for the diagnostics
  int64_t failures = 0;          ///< simulations that failed
  /// mean squared whitened one-step error of the mean that all transitions have informed; 1 = down
  /// to the noise; NaN where nobody knows the noise
  double discrepancy = 0;
  /// of each entry of (q, v), estimated or as recorded, physical units
  Eigen::VectorXd noise_sd;
  /// one-step errors of that mean, whitened, divided by their estimated scale
  Eigen::VectorXd errors;
  std::vector<WindowErrors::Row> rows;  ///< coordinate and transition of each
  std::vector<CurriculumStage> stages;
  Identifiability identifiability;
  /// sd of each parameter's coordinate if nothing but the data told, infinite where they do not
  Eigen::VectorXd cramer_rao;
  std::string advice;  ///< which further motion would tell most of what is left open, in words
  Holdout holdout;
  Misspecification misspecification;  ///< of the model alone, informed by all transitions
  Gap gap;
  /// states (q, v) of the robot for simulated episodes to begin with, of the loop only
  std::vector<Eigen::VectorXd> starts;
  Agreement agreement;
  EffortShift efforts;  ///< rows 0: they act in the rows in which they stand, or nobody has looked
  std::string check;    ///< how the posterior's shape was verified, in words
  std::vector<std::string> warnings;
  double seconds = 0;  ///< wall time
  /// Of plumb-calibrator only: stages, noise, advice, holdout, misspecification, the gap but for
  /// its residual, agreement, check and the counts of simulations then say nothing.
  std::optional<LoopUpdate> loop;
};

}  // namespace plumb
