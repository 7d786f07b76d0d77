#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calibrator/results/findings.h"
#include "calibrator/results/summary.h"
#include "robot/description.h"

namespace plumb {

// The functions here share nothing: thread-safe.

/// Pairs of parameters below the diagonal: 1 and 2 sigma of prior (of the coordinates: exact
/// contours) and of each of the posterior's components, and samples. On the diagonal: the prior's
/// density and a histogram of the samples. Above it: the posterior's correlation of the
/// coordinates.
/// @param shown indices of parameters, at most 8 to be legible.
std::string PairPlot(const Findings& findings, const Summary& summary,
                     const RobotDescription& robot, const std::vector<Eigen::Index>& shown);

}  // namespace plumb
