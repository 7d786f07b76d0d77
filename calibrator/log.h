#pragma once

#include <string>
#include <vector>

#include "calibrator/transitions.h"
#include "robot/description.h"

namespace plumb {

/// What one file tells of a robot's motion. The functions below read a file from beginning to end and hold no more of it
/// than what they return; they are thread-safe, as they share nothing.
struct Log {
  std::string name;               ///< the file
  std::vector<Rollout> rollouts;  ///< each with at least one transition, in the file's order
  DropCounts drops;
  std::vector<std::string> warnings;  ///< what of the file could not be used, for people
};

/// Joins the transitions of all episodes that an LCM log holds: ROBOT_STATE_SMOOTHED and JOINT_COMMAND, whether or not a
/// CONTROLLER_STATUS says that the episode was completed (a log cut off in the middle counts as far as it goes). An episode's
/// last state is the one that CONTROLLER_STATUS names; else the one that the next command, of no episode or another, answers;
/// else the one a control period after its last command's.
/// @throws std::runtime_error naming the file and what is wrong: it cannot be opened, is damaged, has none of these
/// messages, is of a robot with another number of joints, or no transition of it can be used (and why).
Log ReadLcmLog(const std::string& file, const RobotDescription& robot);

/// Reads transitions from a table, one row each:
///   t, q/<joint>..., v/<joint>..., u/<driven joint>..., next_q/<joint>..., next_v/<joint>..., terminated, truncated
/// in any order, further columns ignored. A spherical joint has /w, /x, /y, /z in q and /x, /y, /z in v.
///   t           [s], finite; begins anew, or goes on, with every episode
///   q, v        [rad or m], [rad/s or m/s]: the state s. A row where it is not all known begins no transition
///   u           effort / Task::action_unit, held for the row's control period. As in the simulator, it is clipped to the
///               effort limits and acts simulation.latency late; before all that is known there was no effort
///   next_*      the state s'; nan or empty = not observed. Without these columns, as `plumb sim --csv` writes the table, s' is
///               the next row's state
///   terminated, truncated   optional: not 0 where an episode ends with this row
///
/// An episode ends where a row says so, where t does not go on by one control period, within 20 %, or where s is not what the
/// row before led to: equal to its s', or, in a table most of whose rows follow each other like that, within 20 % of the
/// spread that s has over the table, in every coordinate observed. A row in a stretch of another rate is dropped as `late`. A
/// row that follows no other lasts one control period.
///
/// A table does not say what the noise is. At the end of a transition sds are NaN. At its beginning, they are, too, if s is a
/// reading: the very same one as the end of the transition before, or one of a stretch of such rows, its first included;
/// else the beginning is taken as exact, and they are 0.
///
/// Text is UTF-8, with or without its mark; fields are separated by commas and may be quoted; lines end as on any system,
/// and blank ones and those that begin with # are skipped. Numbers have a decimal point in every locale.
/// @throws std::runtime_error "file:line: ..." for what is no number, infinite, too few or too many fields, a missing, repeated
/// or unknown column (naming the nearest), a time twice in a row; or if no transition can be used (and why).
Log ReadCsvLog(const std::string& file, const RobotDescription& robot);

}  // namespace plumb
