#pragma once

#include <string>

#include "calibrator/motion/log.h"
#include "calibrator/motion/motion_table.h"
#include "robot/description.h"

namespace plumb {

/// Reads transitions from a table with a row for each and these columns, in any order, further ones
/// ignored:
///   t   [s]; begins anew, or goes on, with every episode
///   q/<joint>, v/<joint>   [rad or m], [rad/s or m/s]: the state s. Where it is not known in full,
///       no transition begins. A spherical joint has /w, /x, /y, /z in q, a unit quaternion within
///       a thousandth, and /x, /y, /z in v
///   u/<joint>   of each driven joint: effort / Task::action_unit, held for one control period. As
///       in the simulator, it is clipped to the effort limits and acts simulation.latency late, the
///       one before until then, of which a warning tells; before an episode there was none
///   target_q/<joint>   instead, or besides: where the joint's drive, which runs a position loop of
///       its own, was told to go; kp/<joint>, kd/<joint> must then be robot.toml's (DriveTargets)
///   next_q/<joint>, next_v/<joint>   the state s' that it led to. Without these columns, as
///       `plumb sim --csv` writes the table, s' is the next row's state
///   terminated, truncated   optional: other than 0 where an episode ends with this row
/// nan, or an empty field, stands for an unobserved entry: in s' it is not compared.
///
/// An episode ends where a row says so, where t does not go on by one control period, within 20 %,
/// or where s does not continue the row before. It does if s equals that row's s'; or, in a table
/// most of whose rows nearly do, if every coordinate observed is off by at most 20 % of the spread
/// that s has over the table, or by no more than the noise with which the other rows continue each
/// other. A row that is continued at another time than a control period later is dropped as late. A
/// row that is not continued lasts a control period.
///
/// A table does not say what the noise is. At the end of a transition sds are NaN. At its beginning
/// they are, too, if s is a reading: the very same one as the end of the transition before, or the
/// first of a stretch of such; else the beginning is taken as exact, and they are 0.
///
/// Velocities that are but differences of the positions are told of (DifferencedJoints), and
/// numbers that look like other units than the robot's (table_units.h).
///
/// Fields are separated by commas and may be quoted; blank lines and those that begin with # are
/// skipped. Numbers have a decimal point in every locale.
/// @throws std::runtime_error "file:line: ..." for what is no number, or infinite or not physical
/// (robot/physical.h), too few or too many fields, a missing, repeated or unknown column (naming
/// the nearest), the same time twice in a row; and "file: ..." if it cannot be opened or no
/// transition can be used (and why). Thread-safe.
Log ReadCsvLog(const std::string& file, const RobotDescription& robot);

/// The same of a table in memory (MakeMotionTable). @param name what messages call it.
/// @throws std::runtime_error "name: ..." if no transition can be used. Thread-safe.
Log JoinMotion(const std::string& name, MotionTable table, const RobotDescription& robot);

}  // namespace plumb
