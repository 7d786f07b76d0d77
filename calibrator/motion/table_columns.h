#pragma once

#include <string>
#include <vector>

#include "common/csv_reader.h"
#include "robot/description.h"

namespace plumb {

/// The names that a table's columns may have, in the order of q, v and the actions. Immutable, and
/// so thread-safe.
struct ColumnNames {
  explicit ColumnNames(const RobotDescription& robot);

  std::vector<std::string> q, v;
  std::vector<std::string> u, target, kp, kd;  ///< of each driven joint
};

/// Where things are in a table; -1 if there is no such column.
struct TableColumns {
  int t, terminated, truncated;
  std::vector<int> q, v;
  std::vector<int> u, target, kp, kd;  ///< of each driven joint
  std::vector<int> next_q, next_v;
  bool has_velocities() const { return !v.empty(); }
  bool has_next() const { return !next_q.empty(); }
};

/// Thread-safe. @param robot its name, for messages.
/// @throws as CsvReader::Fail for a column that is missing, naming the nearest, and for one that is
/// of no joint of the robot.
TableColumns FindColumns(const CsvReader& table, const ColumnNames& names,
                         const std::string& robot);

}  // namespace plumb
