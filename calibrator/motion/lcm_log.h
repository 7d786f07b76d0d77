#pragma once

#include <string>

#include "calibrator/motion/log.h"
#include "robot/description.h"

namespace plumb {

/// Joins the transitions of all episodes that an LCM log holds: ROBOT_STATE_SMOOTHED and
/// JOINT_COMMAND, whether or not a CONTROLLER_STATUS says that the episode was completed (a log cut
/// off in the middle counts as far as it goes). An episode's last state is the one that
/// CONTROLLER_STATUS names; else the one that the next command answers, be it of another episode or
/// of none; else the one a control period after its last command's.
/// @throws std::runtime_error naming the file and what is wrong: it cannot be opened, is damaged,
/// has none of these messages, is of another robot (CheckRecordedRobot) or one with another number
/// of joints, or no transition of it can be used (and why).
/// Thread-safe.
Log ReadLcmLog(const std::string& file, const RobotDescription& robot);

}  // namespace plumb
