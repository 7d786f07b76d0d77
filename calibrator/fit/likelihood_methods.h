#pragma once

#include <vector>

#include "calibrator/fit/method.h"

namespace plumb {

// The functions here share nothing: thread-safe.

/// auto, laplace and mixture: the likelihood of windows, its modes and their shapes.
std::vector<Method> LikelihoodMethods();

/// Whether that is the name of one of them. Thread-safe.
bool KnowsLikelihood(const std::string& method);

}  // namespace plumb
