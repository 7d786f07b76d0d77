#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "calibrator/motion/transitions.h"
#include "common/batch_runner.h"
#include "sim/model.h"

namespace plumb {

/// Efforts of another row than that in which they stand.
struct EffortShift {
  int rows = 0;  ///< 1: each acts in the step before its own, which is late; -1: in the one after
  double left = 1;  ///< share of the velocities' squared errors that is left if so
};

/// Whether steps are explained far better by the efforts of the rows after or before theirs. Where
/// efforts are late by a row a fit makes of what is left of them whatever explains it best: masses
/// that are many of the prior's standard deviations away, and errors that look like noise.
///
/// Looks only where errors of a velocity are a tenth of what it changes by in a step or more. Then
/// fits single steps three times, with the same steps and each row's efforts, the one before's and
/// the one after's: 500 transitions at most that have both. Threads as `execution` says.
/// Thread-safe.
/// @param noise_sd of each entry of (q, v), as the errors of one step have it
/// @return rows = 0 unless less than kClearlyShifted is left, and where too few transitions have
/// both neighbours, or a fit fails.
EffortShift FindEffortShift(const std::shared_ptr<const Model>& model,
                            std::span<const Rollout> rollouts, const Eigen::VectorXd& noise_sd,
                            ExecutionOptions execution, int64_t* simulated_steps);

/// What that means, and what to do about it: a sentence. Empty without a shift.
std::string DescribeShift(const EffortShift& shift);

/// Share of the squares that noise alone does not make of another row's efforts.
inline constexpr double kClearlyShifted = 0.5;

}  // namespace plumb
