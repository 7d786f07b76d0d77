#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calibrator/fit/method.h"

namespace plumb {

// The functions here share nothing: thread-safe.

/// auto, laplace and mixture: the likelihood of windows, its modes and their shapes.
std::vector<Method> LikelihoodMethods();

/// What must be said with what a posterior knows: "; but how well is a guess ..." where `mixture`
/// gave it, and fewer than kLeastEss (n + 1) effective importance samples count (FitByImportance).
/// Empty otherwise. Thread-safe. @param used method. @param ess NaN where no samples were drawn.
std::string Doubt(const std::string& used, double ess, Eigen::Index n);

/// Whether that is the name of one of them. Thread-safe.
bool KnowsLikelihood(const std::string& method);

}  // namespace plumb
