#pragma once

#include <Eigen/Core>

#include "robot/description.h"

namespace plumb {

/// RobotDescription::ToPhysical of each column. Thread-safe.
Eigen::MatrixXd PhysicalColumns(const RobotDescription& robot, const Eigen::MatrixXd& coordinates);

}  // namespace plumb
