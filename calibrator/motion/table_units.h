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

/// How many values of an action there are, and how large. Plain data: not thread-safe.
struct ActionCounts {
  int64_t known = 0;
  int64_t clipped = 0;  ///< beyond the effort limit, by more than rounding
  int64_t far = 0;      ///< many times beyond it, where no exploring policy goes
  /// @param asked effort, NaN = not known.
  void Add(double asked, double limit);
};

/// Of an action that is beyond the effort limit in most rows, or many times beyond it in some: of
/// a motor that idles, few rows tell. Else nothing.
/// @param column its name. @param unit [Nm or N] of 1 in it, Task::action_unit.
std::string AskActionUnit(const std::string& column, const JointDescription& joint, double unit,
                          const ActionCounts& counts);

/// Of rows that are so far apart [s] and should be a control period; else nothing.
std::string AskTimeUnit(double interval, double period);

}  // namespace plumb
