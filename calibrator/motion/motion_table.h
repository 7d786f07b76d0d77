#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calibrator/motion/transitions.h"
#include "robot/description.h"

namespace plumb {

// The functions here share nothing: thread-safe.

/// A row of a table of motion as it stands.
struct MotionRow {
  double t;                ///< [s], finite
  bool ends;               ///< the episode
  Eigen::VectorXd effort;  ///< commanded, per velocity, within the limits; NaN = unknown
  /// q, v, and next_q, next_v if the table has them; NaN = unknown. Nothing else yet
  Transition transition;
};

/// A table of motion: see ReadCsvLog.
struct MotionTable {
  /// in the file's order; t differs from row to row but where an episode ends
  std::vector<MotionRow> rows;
  bool has_next = false;       ///< next_ columns are there
  bool has_velocities = true;  ///< else they are differences of the positions
  std::vector<std::string> warnings;
};

/// @throws std::runtime_error for all that is wrong with columns and fields: see ReadCsvLog.
MotionTable ReadMotionTable(const std::string& file, const RobotDescription& robot);

/// Columns of a table in memory, a row for each control step: as in a file (ReadCsvLog), NaN = not
/// known.
struct MotionColumns {
  Eigen::VectorXd t;               ///< [s]
  Eigen::MatrixXd q, v, u;         ///< rows x num_positions, num_velocities, driven joints
  Eigen::MatrixXd next_q, next_v;  ///< likewise, or both empty
  std::vector<bool> ends;          ///< the episode; empty = none does
};

/// The same of numbers in memory. @throws std::invalid_argument naming the column that is of the
/// wrong size, infinite or not physical, and its row, counted from 0.
MotionTable MakeMotionTable(const MotionColumns& columns, const RobotDescription& robot);

/// Standard deviation of each coordinate of (q, v) over the rows; NaN where it was never observed.
/// Empty without rows.
Eigen::VectorXd Spread(const std::vector<MotionRow>& rows);

}  // namespace plumb
