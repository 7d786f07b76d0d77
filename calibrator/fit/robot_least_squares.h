#pragma once

#include "calibrator/fit/window_errors.h"
#include "calibrator/inference/laplace.h"
#include "robot/description.h"

namespace plumb {

// Thread-safe, but for errors that two threads would share.

/// The prior of a robot's parameters, in their coordinates.
Prior PriorOf(const RobotDescription& robot);

/// Errors of windows as a least-squares problem: a noise scale for each entry of (q, v), a block
/// for each recorded state, a cluster for each stretch of at least 25 control steps. `errors` must
/// outlive it.
LeastSquares ProblemOf(const RobotDescription& robot, WindowErrors& errors);

}  // namespace plumb
