#include "calibrator/motion/table_columns.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/nearest_name.h"
#include "robot/coordinate_names.h"

namespace plumb {
namespace {

std::vector<std::string> Prefixed(const char* prefix, std::vector<std::string> names) {
  for (std::string& name : names) name.insert(0, prefix);
  return names;
}

std::vector<int> FindAll(const CsvReader& table, const std::vector<std::string>& names) {
  std::vector<int> columns;
  for (const std::string& name : names) {
    columns.push_back(table.Find(name));
    if (columns.back() < 0) {
      table.Fail(fmt::format("has no column '{}'; the nearest is {}", name,
                             Quoted(NearestName(name, table.names()))));
    }
  }
  return columns;
}

bool OfMotor(const std::string& column) {
  return !column.starts_with("q/") && !column.starts_with("v/") && !column.starts_with("next_");
}

// A column that looks like a joint's but is of none of this robot's is of another robot, or
// misspelt: its values would be ignored in silence.
void RefuseForeign(const CsvReader& table, const std::vector<std::string>& known,
                   const std::string& robot) {
  constexpr const char* kPrefixes[] = {"q/",  "v/",  "u/",      "next_q/",
                                       "kp/", "kd/", "next_v/", "target_q/"};
  for (const std::string& name : table.names()) {
    const bool of_a_joint =
        std::any_of(std::begin(kPrefixes), std::end(kPrefixes),
                    [&](const char* prefix) { return name.starts_with(prefix); });
    if (of_a_joint && std::find(known.begin(), known.end(), name) == known.end()) {
      table.Fail(fmt::format("column {} is of no joint{} of robot '{}'; the nearest is '{}'",
                             Quoted(name), OfMotor(name) ? " with a motor" : "", robot,
                             NearestName(name, known)));
    }
  }
}

std::vector<int> FindAny(const CsvReader& table, const std::vector<std::string>& names) {
  std::vector<int> columns;
  columns.reserve(names.size());
  for (const std::string& name : names) columns.push_back(table.Find(name));
  return columns;
}

bool HasAny(const CsvReader& table, const std::vector<std::string>& names) {
  return std::ranges::any_of(FindAny(table, names), [](int column) { return column >= 0; });
}

}  // namespace

ColumnNames::ColumnNames(const RobotDescription& robot) {
  const CoordinateNames names(robot);
  q = Prefixed("q/", names.q), v = Prefixed("v/", names.v);
  for (const int driven : robot.driven()) {
    const std::string& joint = robot.joints[static_cast<size_t>(driven)].name;
    u.push_back("u/" + joint), target.push_back("target_q/" + joint);
    kp.push_back("kp/" + joint), kd.push_back("kd/" + joint);
  }
}

TableColumns FindColumns(const CsvReader& table, const ColumnNames& names,
                         const std::string& robot) {
  const std::vector<std::string> next_q = Prefixed("next_", names.q),
                                 next_v = Prefixed("next_", names.v);
  std::vector<std::string> known;
  for (const auto* some :
       {&names.q, &names.v, &names.u, &names.target, &names.kp, &names.kd, &next_q, &next_v}) {
    known.insert(known.end(), some->begin(), some->end());
  }
  RefuseForeign(table, known, robot);
  TableColumns columns{FindAll(table, {"t"})[0],
                       table.Find("terminated"),
                       table.Find("truncated"),
                       FindAll(table, names.q),
                       {},
                       FindAny(table, names.u),
                       FindAny(table, names.target),
                       FindAny(table, names.kp),
                       FindAny(table, names.kd),
                       {},
                       {}};
  // Says what lacks: of a table of targets it is one of these.
  const bool of_targets = HasAny(table, names.target);
  for (size_t i = 0; i < columns.u.size(); ++i) {
    if (columns.u[i] < 0 && columns.target[i] < 0)
      FindAll(table, {of_targets ? names.target[i] : names.u[i]});
  }
  const bool has_next = HasAny(table, next_q) || HasAny(table, next_v);
  if (has_next || HasAny(table, names.v)) columns.v = FindAll(table, names.v);
  if (has_next) {
    columns.next_q = FindAll(table, next_q);
    columns.next_v = FindAll(table, next_v);
  }
  return columns;
}

}  // namespace plumb
