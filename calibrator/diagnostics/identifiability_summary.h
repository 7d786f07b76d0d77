#pragma once

#include <Eigen/Core>
#include <string>

#include "calibrator/diagnostics/identifiability.h"
#include "robot/description.h"

namespace plumb {

// The functions here share nothing: thread-safe.

/// Whether all parameters with a power have logarithmic coordinates.
bool AllLog(const RobotDescription& robot, const Eigen::VectorXd& power);

/// "gravity / length", "mass length^2"; a sum where a coordinate is not logarithmic.
std::string CombinationName(const RobotDescription& robot, const Eigen::VectorXd& power);

/// "gravity +1 %, mass -2 %, length +1 %": a small step along a direction in the coordinates from
/// `mean`. Parameters whose coordinate is not logarithmic move in their unit.
std::string DirectionName(const RobotDescription& robot, const Eigen::VectorXd& mean,
                          const Eigen::VectorXd& direction);

/// Everything that was found, for people. @param mean of the coordinates.
std::string IdentifiabilitySummary(const RobotDescription& robot, const Eigen::VectorXd& mean,
                                   const Identifiability& found);

}  // namespace plumb
