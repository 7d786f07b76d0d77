#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "calibrator/motion/motion_table.h"
#include "robot/description.h"

namespace plumb {

// A table in other units than the robot's is read without complaint. What then is far beyond what
// the robot can do is asked about, for people, as nothing of it is certain. Thread-safe.

/// Of positions far beyond their joints' limits in most rows, and of speeds beyond theirs.
/// @param velocities have columns of their own; else they are differences of the positions.
std::vector<std::string> AskStateUnits(const std::vector<MotionRow>& rows, bool velocities,
                                       const RobotDescription& robot);

/// Of an action that is beyond the effort limit in most rows; else nothing.
/// @param column its name. @param unit [Nm or N] of 1 in it, Task::action_unit.
/// @param clipped so many of its `known` values.
std::string AskActionUnit(const std::string& column, const JointDescription& joint, double unit,
                          int64_t clipped, int64_t known);

/// Of rows that are so far apart [s] and should be a control period; else nothing.
std::string AskTimeUnit(double interval, double period);

}  // namespace plumb
