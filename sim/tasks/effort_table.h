#pragma once

#include <Eigen/Core>
#include <string>

#include "robot/description.h"
#include "sim/tasks/task.h"

namespace plumb {

/// Reads efforts that are to be applied one after the other, whatever the robot does: what `plumb
/// excite` writes. A row for each control step, with the columns t [s] and u/<joint> of each driven
/// joint, effort / Task::action_unit; others are ignored.
/// @return control steps x driven joints, policy units, -1 to 1 = the effort limits.
/// @throws std::runtime_error "file:line: ..." for what is no number, an effort beyond its limit,
/// times that are not a control period apart (within a hundredth), a missing column (naming the
/// nearest); "file: ..." if it cannot be opened or has no row. Thread-safe.
Eigen::MatrixXf ReadEffortTable(const std::string& file, const RobotDescription& robot,
                                const Task& task);

}  // namespace plumb
