#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "robot/description.h"

namespace plumb {

/// Paths of parameters that a model has wrong, and their true values in physical units.
using Changes = std::vector<std::pair<std::string, double>>;

/// A robot that is not quite the one that is fitted to its motion.
struct ChangedRobot {
  RobotDescription description;  ///< with what was changed as parameters after its own
  Eigen::VectorXd physical;      ///< the true values of all of these
};

/// @param seed of the fitted parameters' true values (HiddenParameters).
ChangedRobot Change(const RobotDescription& fitted, const Changes& changes, uint64_t seed);

}  // namespace plumb
