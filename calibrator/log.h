#pragma once

#include <string>
#include <vector>

#include "calibrator/transitions.h"
#include "robot/description.h"

namespace plumb {

/// What one file tells of a robot's motion.
struct Log {
  std::string name;               ///< the file
  std::vector<Rollout> rollouts;  ///< with at least one transition together
  DropCounts drops;
  std::vector<std::string> warnings;  ///< what of the file could not be used, for people
};

/// Joins the transitions of all episodes that an LCM log holds: ROBOT_STATE_SMOOTHED and JOINT_COMMAND, whether or not a
/// CONTROLLER_STATUS says that the episode was completed (a log cut off in the middle counts as far as it goes).
/// @throws std::runtime_error naming the file and what is wrong: it cannot be opened, is damaged, has none of these
/// messages, is of a robot with another number of joints, or no transition of it can be used (and why).
Log ReadLcmLog(const std::string& file, const RobotDescription& robot);

/// Reads transitions from a table with the columns
///   t, q/<joint>..., v/<joint>..., u/<joint>..., next_q/<joint>..., next_v/<joint>...
/// in any order, further ones ignored; u as the task defines the action (Task::action_unit); nan = not observed, and not
/// compared. Without the next_ columns, as `plumb sim --csv` writes it, s' is the next row's state. An episode ends where t
/// does not go on by one control period, within 20 %, or s is not what the row before led to.
/// Where the file does not say what the noise is, sds are NaN: at the end of each transition, and at its beginning, too, if
/// that is the very same reading as the end of the one before; else the beginning is taken as exact.
/// @throws std::runtime_error "file:line: ..." for what is no number, too few or too many fields, a missing or unknown
/// column (naming the nearest), a repeated time; or if no transition can be used (and why).
Log ReadCsvLog(const std::string& file, const RobotDescription& robot);

}  // namespace plumb
