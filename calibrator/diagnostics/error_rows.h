#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <vector>

#include "calibrator/diagnostics/projected_errors.h"

namespace plumb {

// Which errors a test looks at, and what people call that. The functions here share nothing:
// thread-safe.

/// Rows of ProjectedErrors, ascending.
using ErrorRows = std::vector<Eigen::Index>;

/// "contact" and "free" where these can be told apart, else one that is empty: all there are.
std::vector<std::string> Conditions(const ProjectedErrors& errors);

/// The rows of some coordinates. @param condition one of Conditions, or empty. @param outliers
/// whether those belong to it, which ProjectedErrors::Out leaves out.
ErrorRows RowsWhere(const ProjectedErrors& errors, const std::function<bool(int coordinate)>& which,
                    const std::string& condition, bool outliers = false);

double SumOfSquares(const ProjectedErrors& errors, const ErrorRows& rows);

/// "speed of knee". @param coordinate 0 ... n - 1: of q's differences, n ... 2 n - 1: of v.
std::string CoordinateName(const ProjectedErrors& errors, int coordinate);
const std::string& JointOf(const ProjectedErrors& errors, int coordinate);

}  // namespace plumb
