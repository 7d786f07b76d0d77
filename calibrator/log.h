#pragma once

#include <string>
#include <vector>

#include "calibrator/transitions.h"
#include "robot/description.h"

namespace plumb {

/// What one file tells of a robot's motion. The functions below read a file once, from beginning to
/// end. They share nothing, hence are thread-safe.
struct Log {
  std::string name;               ///< the file
  std::vector<Rollout> rollouts;  ///< each with at least one transition, in the file's order
  DropCounts drops;
  std::vector<std::string> warnings;  ///< what of the file could not be used, for people
};

/// Joins the transitions of all episodes that an LCM log holds: ROBOT_STATE_SMOOTHED and
/// JOINT_COMMAND, whether or not a CONTROLLER_STATUS says that the episode was completed (a log cut
/// off in the middle counts as far as it goes). An episode's last state is the one that
/// CONTROLLER_STATUS names; else the one that the next command answers, be it of another episode or
/// of none; else the one a control period after its last command's.
/// @throws std::runtime_error naming the file and what is wrong: it cannot be opened, is damaged,
/// has none of these messages, is of a robot with another number of joints, or no transition of it
/// can be used (and why).
Log ReadLcmLog(const std::string& file, const RobotDescription& robot);

/// Reads transitions from a table with a row for each and these columns, in any order, further ones
/// ignored:
///   t   [s]; begins anew, or goes on, with every episode
///   q/<joint>, v/<joint>   [rad or m], [rad/s or m/s]: the state s. Where it is not known in full,
///       no transition begins. A spherical joint has /w, /x, /y, /z in q and /x, /y, /z in v
///   u/<driven joint>   effort / Task::action_unit, held for one control period. As in the
///       simulator, it is clipped to the effort limits and acts simulation.latency late, the one
///       before until then; before an episode there was none
///   next_q/<joint>, next_v/<joint>   the state s' that it led to. Without these columns, as
///       `plumb sim --csv` writes the table, s' is the next row's state
///   terminated, truncated   optional: other than 0 where an episode ends with this row
/// nan, or nothing, stands for what was not observed: in s' it is not compared.
///
/// An episode ends where a row says so, where t does not go on by one control period, within 20 %,
/// or where s is not what the row before led to. That is s' itself; or, in a table whose rows
/// follow each other in most coordinates like that, what is within 20 % of the spread that s has
/// over the table, or within what noise makes of most rows, in every coordinate observed. A row
/// that is followed like that, but at another time, is dropped as late. One that is not lasts a
/// control period.
///
/// A table does not say what the noise is. At the end of a transition sds are NaN. At its beginning
/// they are, too, if s is a reading: the very same one as the end of the transition before, or the
/// first of a stretch of such; else the beginning is taken as exact, and they are 0.
///
/// Fields are separated by commas and may be quoted; blank lines and those that begin with # are
/// skipped. Numbers have a decimal point in every locale.
/// @throws std::runtime_error "file:line: ..." for what is no number, or infinite, too few or too
/// many fields, a missing, repeated or unknown column (naming the nearest), the same time twice in
/// a row; and "file: ..." if it cannot be opened or no transition can be used (and why).
Log ReadCsvLog(const std::string& file, const RobotDescription& robot);

}  // namespace plumb
