#pragma once

#include <vector>

#include "calibrator/fit/method.h"

namespace plumb {

// The functions here share nothing: thread-safe.

/// Methods that know only simulations (RobotProblem): approximate Bayesian computation and the
/// like.
std::vector<Method> AbcMethods();

}  // namespace plumb
