#pragma once

#include <memory>
#include <span>
#include <vector>

#include "calibrator/discrepancy.h"
#include "calibrator/findings.h"

namespace plumb {

/// Transitions to fit, and those kept back to judge the fit by.
struct Split {
  std::vector<Rollout> fitted, held_out;
};

/// Every fifth roll-out is held out; of fewer than five, the last fifth of each. What has fewer
/// than ten transitions cannot spare any: nothing is held out.
Split HoldOut(std::span<const Rollout> rollouts);

/// Errors of predicting 1, 2, 5, 10, 20 and 50 steps ahead. @param posterior, prior means, physical
/// units.
Holdout Judge(Discrepancy& discrepancy, const Split& split, const Eigen::VectorXd& posterior,
              const Eigen::VectorXd& prior);

}  // namespace plumb
