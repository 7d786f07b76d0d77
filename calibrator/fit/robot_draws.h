#pragma once

#include <Eigen/Core>
#include <functional>

#include "sim/model.h"

namespace plumb {

/// Draws parameters that a robot can have. A Gaussian reaches everywhere: what no robot can have, a
/// mass below zero, is drawn again. Thread-safe if `draw` is.
/// @param draw one, in coordinates. @return a column for each of `count`, coordinates.
/// @throws std::invalid_argument saying why if less than one draw in a hundred is a robot.
Eigen::MatrixXd DrawRobots(const Model& model, Eigen::Index count,
                           const std::function<Eigen::VectorXd()>& draw);

}  // namespace plumb
