#include "calibrator/motion/motion_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <utility>

#include "calibrator/motion/differences.h"
#include "calibrator/motion/drive_targets.h"
#include "calibrator/motion/table_columns.h"
#include "calibrator/motion/table_units.h"
#include "common/csv_reader.h"
#include "common/special_numbers.h"
#include "robot/configuration_space.h"
#include "robot/physical.h"
#include "sim/tasks/task.h"

namespace plumb {
namespace {

constexpr double kLatest = 1e12;  // [s]; Unix time in nanoseconds is none

double Number(const CsvReader& table, int column, double greatest = kGreatestQuantity) {
  const double number = table.Number(column);
  if (std::abs(number) > greatest) {
    table.Fail(fmt::format("{} is {}: beyond {} nothing is a robot's",
                           Quoted(table.names()[static_cast<size_t>(column)]), number, greatest));
  }
  return number;
}

Eigen::VectorXd Numbers(const CsvReader& table, const std::vector<int>& columns) {
  Eigen::VectorXd numbers(columns.size());
  std::transform(columns.begin(), columns.end(), numbers.begin(),
                 [&](int column) { return Number(table, column); });
  return numbers;
}

// A joint with a target only has no effort besides.
Eigen::VectorXd Actions(const CsvReader& table, const std::vector<int>& columns) {
  Eigen::VectorXd actions(columns.size());
  std::transform(columns.begin(), columns.end(), actions.begin(),
                 [&](int column) { return column < 0 ? 0 : Number(table, column); });
  return actions;
}

bool Flag(const CsvReader& table, int column) {
  if (column < 0) return false;
  const std::string_view text = table.Text(column);
  if (text == "True" || text == "true") return true;
  if (text == "False" || text == "false") return false;
  const double number = table.Number(column);
  return number != 0 && !std::isnan(number);
}

/// Actions to efforts as the simulator has them.
class Efforts {
 public:
  explicit Efforts(const RobotDescription& robot)
      : task_(MakeTask(robot)),
        limits_(robot.effort_limits()),
        velocities_(robot.num_velocities()),
        counts_(robot.driven().size()) {}

  Eigen::VectorXd operator()(const Eigen::VectorXd& action) {
    Eigen::VectorXd effort = Eigen::VectorXd::Zero(velocities_);
    for (int i = 0; i < action.size(); ++i) {
      const double asked = action(i) * task_->action_unit(i);
      double& given = effort(task_->action_indices()[static_cast<size_t>(i)]);
      given = std::isnan(asked) ? kNaN : std::clamp(asked, -limits_(i), limits_(i));
      counts_[static_cast<size_t>(i)].Add(asked, limits_(i));
    }
    return effort;
  }

  std::vector<std::string> Warnings(const ColumnNames& names, const RobotDescription& robot) const {
    std::vector<std::string> warnings;
    int64_t clipped = 0;
    for (const ActionCounts& counts : counts_) clipped += counts.clipped;
    if (clipped > 0) {
      warnings.push_back(fmt::format(
          "{} actions go beyond the effort limits: clipped, as the task does", clipped));
    }
    const std::vector<int> driven = robot.driven();
    for (size_t i = 0; i < counts_.size(); ++i) {
      std::string question = AskActionUnit(names.u[i], robot.joints[static_cast<size_t>(driven[i])],
                                           task_->action_unit(static_cast<int>(i)), counts_[i]);
      if (!question.empty()) warnings.push_back(std::move(question));
    }
    return warnings;
  }

 private:
  std::unique_ptr<Task> task_;
  Eigen::VectorXd limits_;
  int velocities_;
  std::vector<ActionCounts> counts_;  // of each action
};

/// Quaternions of unit length, each the continuation of the row's before.
/// @return what is wrong with one that is none; empty if there is none such.
std::string Normalise(const ConfigurationSpace& space, const std::vector<MotionRow>& rows,
                      MotionRow* row) {
  if (space.flat()) return {};
  Transition& t = row->transition;
  std::string fault = space.Normalise(rows.empty() ? t.q : rows.back().transition.q, t.q);
  if (!fault.empty()) return "q " + fault;
  if (t.next_q.size() > 0) fault = space.Normalise(t.q, t.next_q);
  return fault.empty() ? fault : "next_q " + fault;
}

/// Says what is wrong with a row of a file: its reader names file and line.
class FaultsInFile {
 public:
  explicit FaultsInFile(const CsvReader& table) : table_(table) {}
  void NoTime() const { table_.Fail("t must be known"); }
  void SameTime(double t) const { table_.Fail(fmt::format("t is {}, as in the row before", t)); }
  void NoState(const std::string& fault) const { table_.Fail(fault); }

 private:
  const CsvReader& table_;
};

/// The same of a row in memory, by its number.
class FaultsInMemory {
 public:
  explicit FaultsInMemory(Eigen::Index row) : row_(row) {}
  void NoTime() const { Fail(fmt::format("t: is not known in row {}", row_)); }
  void SameTime(double t) const {
    Fail(fmt::format("t: is {} in row {}, as in the row before", t, row_));
  }
  void NoState(const std::string& fault) const { Fail(fmt::format("{}, in row {}", fault, row_)); }

 private:
  [[noreturn]] static void Fail(const std::string& what) { throw std::invalid_argument(what); }

  Eigen::Index row_;
};

/// Judges a row, and appends it. @param read fills in the states, once the time is known to be
/// good: of several faults in a row the first is told. @param faults throws.
template <class Read, class Faults>
void AppendRow(const ConfigurationSpace& space, MotionRow row, const Read& read,
               const Faults& faults, std::vector<MotionRow>* rows) {
  if (std::isnan(row.t)) faults.NoTime();
  if (!rows->empty() && !rows->back().ends && rows->back().t == row.t) faults.SameTime(row.t);
  read(&row.transition);
  if (const std::string fault = Normalise(space, *rows, &row); !fault.empty())
    faults.NoState(fault);
  rows->push_back(std::move(row));
}

std::vector<MotionRow> ReadRows(CsvReader& table, const TableColumns& columns,
                                const RobotDescription& robot, Efforts& efforts) {
  const ConfigurationSpace space(robot);
  const DriveTargets targets(table, robot, columns.target, columns.kp, columns.kd);
  const Eigen::VectorXd no_velocity = Eigen::VectorXd::Constant(space.num_velocities(), kNaN);
  const auto read = [&](Transition* transition) {
    transition->q = Numbers(table, columns.q);
    transition->v = columns.has_velocities() ? Numbers(table, columns.v) : no_velocity;
    if (!columns.has_next()) return;
    transition->next_q = Numbers(table, columns.next_q);
    transition->next_v = Numbers(table, columns.next_v);
  };
  std::vector<MotionRow> rows;
  while (table.Next()) {
    MotionRow row{Number(table, columns.t, kLatest),
                  Flag(table, columns.terminated) || Flag(table, columns.truncated),
                  efforts(Actions(table, columns.u)) + targets.Effort(),
                  {}};
    AppendRow(space, std::move(row), read, FaultsInFile(table), &rows);
  }
  if (!columns.has_velocities()) DifferencePositions(space, robot.task.period, &rows);
  return rows;
}

std::vector<std::string> Warnings(const MotionTable& motion, const Efforts& efforts,
                                  const RobotDescription& robot) {
  const std::vector<MotionRow>& rows = motion.rows;
  if (rows.empty()) return {};
  const ColumnNames names(robot);
  std::vector<std::string> states = names.q, still, missing, warnings;
  states.insert(states.end(), names.v.begin(), names.v.end());
  const Eigen::VectorXd spread = Spread(rows);
  for (size_t i = 0; i < states.size(); ++i) {
    const double s = spread(static_cast<Eigen::Index>(i));
    if (std::isnan(s)) missing.push_back(states[i]);
    if (s == 0 && rows.size() > 1) still.push_back(states[i]);
  }
  if (!missing.empty())
    warnings.push_back(fmt::format("never observed: {}", fmt::join(missing, ", ")));
  if (!still.empty())
    warnings.push_back(fmt::format("the same in all rows: {}", fmt::join(still, ", ")));
  for (std::string& warning : efforts.Warnings(names, robot))
    warnings.push_back(std::move(warning));
  for (std::string& question : AskStateUnits(rows, motion.has_velocities, robot))
    warnings.push_back(std::move(question));
  return warnings;
}

/// Whatever comes from a program is checked as what comes from a file.
class CheckedColumns {
 public:
  explicit CheckedColumns(const MotionColumns& columns) : rows_(columns.t.size()) {}

  void Require(const char* name, const Eigen::Ref<const Eigen::MatrixXd>& numbers,
               Eigen::Index columns, double greatest = kGreatestQuantity) const {
    if (numbers.rows() != rows_ || numbers.cols() != columns) {
      throw std::invalid_argument(fmt::format("{}: is {} x {}, needs {} x {}", name, numbers.rows(),
                                              numbers.cols(), rows_, columns));
    }
    for (Eigen::Index row = 0; row < rows_; ++row) {
      for (const double number : numbers.row(row)) {
        if (!(std::abs(number) > greatest)) continue;
        throw std::invalid_argument(fmt::format(
            "{}: is {} in row {}: beyond {} nothing is a robot's", name, number, row, greatest));
      }
    }
  }

 private:
  Eigen::Index rows_;
};

}  // namespace

MotionTable ReadMotionTable(const std::string& file, const RobotDescription& robot) {
  CsvReader table(file);
  const ColumnNames names(robot);
  const TableColumns columns = FindColumns(table, names, robot.name);
  Efforts efforts(robot);
  MotionTable motion{
      ReadRows(table, columns, robot, efforts), columns.has_next(), columns.has_velocities(), {}};
  motion.warnings = Warnings(motion, efforts, robot);
  return motion;
}

MotionTable MakeMotionTable(const MotionColumns& columns, const RobotDescription& robot) {
  const Eigen::Index rows = columns.t.size(), n = robot.num_positions(), m = robot.num_velocities();
  const CheckedColumns checked(columns);
  checked.Require("t", columns.t, 1, kLatest);
  checked.Require("q", columns.q, n), checked.Require("v", columns.v, m);
  checked.Require("u", columns.u, static_cast<Eigen::Index>(robot.driven().size()));
  const bool has_next = columns.next_q.size() > 0 || columns.next_v.size() > 0;
  if (has_next)
    checked.Require("next_q", columns.next_q, n), checked.Require("next_v", columns.next_v, m);
  if (!columns.ends.empty() && columns.ends.size() != static_cast<size_t>(rows))
    throw std::invalid_argument("terminated, truncated: one entry for each row");
  Efforts efforts(robot);
  const ConfigurationSpace space(robot);
  MotionTable motion{{}, has_next, true, {}};
  for (Eigen::Index i = 0; i < rows; ++i) {
    MotionRow row{columns.t(i),
                  !columns.ends.empty() && columns.ends[static_cast<size_t>(i)],
                  efforts(columns.u.row(i)),
                  {}};
    const auto read = [&](Transition* transition) {
      transition->q = columns.q.row(i), transition->v = columns.v.row(i);
      if (has_next)
        transition->next_q = columns.next_q.row(i), transition->next_v = columns.next_v.row(i);
    };
    AppendRow(space, std::move(row), read, FaultsInMemory(i), &motion.rows);
  }
  motion.warnings = Warnings(motion, efforts, robot);
  return motion;
}

Eigen::VectorXd Spread(const std::vector<MotionRow>& rows) {
  if (rows.empty()) return {};
  const Eigen::Index n = rows[0].transition.q.size();
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(n + rows[0].transition.v.size()), squares = mean,
                  count = mean;
  for (const MotionRow& row : rows) {
    for (Eigen::Index i = 0; i < mean.size(); ++i) {
      const double s = i < n ? row.transition.q(i) : row.transition.v(i - n);
      if (std::isnan(s)) continue;
      const double from_mean = s - mean(i);
      mean(i) += from_mean / ++count(i);
      squares(i) += from_mean * (s - mean(i));
    }
  }
  return (squares.array() / count.array()).sqrt();
}

}  // namespace plumb
