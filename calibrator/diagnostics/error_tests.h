#pragma once

#include <vector>

#include "calibrator/diagnostics/projected_errors.h"

namespace plumb {

// The functions here share nothing: thread-safe.

/// Tests of errors for what they are themselves: scale, outliers, whiteness and bias. p not
/// corrected; all, whether they count or not.
std::vector<Misfit> TestScale(const ProjectedErrors& errors, const std::vector<bool>& noise_known);
std::vector<Misfit> TestOutliers(const ProjectedErrors& errors);
std::vector<Misfit> TestWhiteness(const ProjectedErrors& errors);
std::vector<Misfit> TestBias(const ProjectedErrors& errors);
/// Tests for dependence on the state and the effort, one per coordinate.
std::vector<Misfit> TestRegression(const ProjectedErrors& errors);

}  // namespace plumb
