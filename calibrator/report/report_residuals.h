#pragma once

#include <string>
#include <vector>

#include "calibrator/report/residuals.h"

namespace plumb {

// The functions here share nothing: thread-safe.

/// The report's panel about residuals, HTML; says so where there are none.
/// @throws std::invalid_argument if residuals, rows and coordinates do not fit each other.
std::string ResidualPanel(const Residuals& residuals);

/// Autocorrelation of one coordinate's residuals at lags 1 to `lags`: of transitions of one
/// roll-out that are so far apart, over their variance about their mean. NaN where there are none.
/// @param coordinate index into residuals.coordinates.
std::vector<double> Autocorrelation(const Residuals& residuals, int coordinate, int lags);

}  // namespace plumb
