#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <stdexcept>
#include <utility>

#include "calibrator/csv_table.h"
#include "calibrator/log.h"
#include "common/config.h"
#include "sim/tasks/task.h"

namespace plumb {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kPeriodTolerance = 0.2;   // as TransitionJoiner's
constexpr double kSamePeriod = 1e-6;       // decimal fractions in binary: the period itself was meant
constexpr double kNearlyTheSame = 0.2;     // of the spread of s: no further from what the row before led to
constexpr double kBeyondLimit = 1 + 1e-9;  // an effort so far beyond its limit is not just rounded

/// What the columns are called, in the order of q, v and the actions.
struct Names {
  std::vector<std::string> q, v, u;

  explicit Names(const RobotDescription& robot) {
    for (const JointDescription& joint : robot.joints) {
      if (joint.type == JointDescription::Type::kSpherical) {
        for (const char* part : {"/w", "/x", "/y", "/z"}) q.push_back("q/" + joint.name + part);
        for (const char* part : {"/x", "/y", "/z"}) v.push_back("v/" + joint.name + part);
      } else {
        q.push_back("q/" + joint.name);
        v.push_back("v/" + joint.name);
      }
      if (!joint.passive) u.push_back("u/" + joint.name);
    }
  }
};

std::vector<std::string> Prefixed(std::vector<std::string> names) {
  for (std::string& name : names) name.insert(0, "next_");
  return names;
}

const std::string& Nearest(const std::string& name, const std::vector<std::string>& among) {
  // Names of unknown origin may be of any length: no more of them is compared than a joint's name has.
  const auto distance = [&](const std::string& other) { return EditDistance(name.substr(0, 200), other.substr(0, 200)); };
  return *std::min_element(among.begin(), among.end(), [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
}

/// Where things are in a table.
struct Columns {
  int t, terminated, truncated;  // the latter two -1 if there is none
  std::vector<int> q, v, u, next_q, next_v;
  bool has_next() const { return !next_q.empty(); }
};

std::vector<int> FindAll(const CsvTable& table, const std::vector<std::string>& names) {
  std::vector<int> columns;
  for (const std::string& name : names) {
    columns.push_back(table.Find(name));
    if (columns.back() < 0) {
      table.Fail(fmt::format("has no column '{}'; the nearest is {}", name, Quoted(Nearest(name, table.names()))));
    }
  }
  return columns;
}

// A column that looks like a joint's but is of none of this robot's is of another robot, or misspelt: its values would be
// ignored in silence.
void RefuseForeign(const CsvTable& table, const std::vector<std::string>& known, const std::string& robot) {
  constexpr const char* kPrefixes[] = {"q/", "v/", "u/", "next_q/", "next_v/"};
  for (const std::string& name : table.names()) {
    const bool of_a_joint = std::any_of(std::begin(kPrefixes), std::end(kPrefixes),
                                        [&](const char* prefix) { return name.starts_with(prefix); });
    if (of_a_joint && std::find(known.begin(), known.end(), name) == known.end()) {
      table.Fail(fmt::format("column {} is of no joint{} of robot '{}'; the nearest is '{}'", Quoted(name),
                             name.starts_with("u/") ? " with a motor" : "", robot, Nearest(name, known)));
    }
  }
}

Columns FindColumns(const CsvTable& table, const RobotDescription& robot) {
  const Names names(robot);
  const std::vector<std::string> next_q = Prefixed(names.q), next_v = Prefixed(names.v);
  std::vector<std::string> known;
  for (const auto* some : {&names.q, &names.v, &names.u, &next_q, &next_v}) known.insert(known.end(), some->begin(), some->end());
  RefuseForeign(table, known, robot.name);
  Columns columns{FindAll(table, {"t"})[0], table.Find("terminated"), table.Find("truncated"), FindAll(table, names.q),
                  FindAll(table, names.v),  FindAll(table, names.u),  {},                      {}};
  const auto is_there = [&](const std::string& name) { return table.Find(name) >= 0; };
  if (std::any_of(next_q.begin(), next_q.end(), is_there) || std::any_of(next_v.begin(), next_v.end(), is_there)) {
    columns.next_q = FindAll(table, next_q);
    columns.next_v = FindAll(table, next_v);
  }
  return columns;
}

/// A row as it stands. Its transition has states; efforts and sds follow from the rows around it.
struct Row {
  double t;
  bool ends;               // the episode
  Eigen::VectorXd effort;  // per velocity, NaN = unknown
  Transition transition;
};

Eigen::VectorXd Numbers(const CsvTable& table, const std::vector<int>& columns) {
  Eigen::VectorXd numbers(columns.size());
  std::transform(columns.begin(), columns.end(), numbers.begin(), [&](int column) { return table.Number(column); });
  return numbers;
}

bool Flag(const CsvTable& table, int column) {
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
      : task_(MakeTask(robot)), limits_(robot.effort_limits()), velocities_(robot.num_velocities()) {}

  Eigen::VectorXd operator()(const Eigen::VectorXd& action) {
    Eigen::VectorXd effort = Eigen::VectorXd::Zero(velocities_);
    for (int i = 0; i < action.size(); ++i) {
      const double asked = action(i) * task_->action_unit(i);
      double& given = effort(task_->action_indices()[static_cast<size_t>(i)]);
      given = std::isnan(asked) ? kNaN : std::clamp(asked, -limits_(i), limits_(i));
      clipped_ += std::abs(asked) > limits_(i) * kBeyondLimit;
    }
    return effort;
  }
  int64_t clipped() const { return clipped_; }

 private:
  std::unique_ptr<Task> task_;
  Eigen::VectorXd limits_;
  int velocities_;
  int64_t clipped_ = 0;
};

std::vector<Row> ReadRows(CsvTable& table, const Columns& columns, Efforts& efforts) {
  std::vector<Row> rows;
  while (table.Next()) {
    Row row{table.Number(columns.t), Flag(table, columns.terminated) || Flag(table, columns.truncated),
            efforts(Numbers(table, columns.u)), {}};
    if (std::isnan(row.t)) table.Fail("t must be known");
    if (!rows.empty() && !rows.back().ends && rows.back().t == row.t) {
      table.Fail(fmt::format("t is {}, as in the row before", row.t));
    }
    row.transition.q = Numbers(table, columns.q);
    row.transition.v = Numbers(table, columns.v);
    if (columns.has_next()) {
      row.transition.next_q = Numbers(table, columns.next_q);
      row.transition.next_v = Numbers(table, columns.next_v);
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

Eigen::VectorXd Start(const Row& row) {
  return (Eigen::VectorXd(row.transition.q.size() + row.transition.v.size()) << row.transition.q, row.transition.v).finished();
}
Eigen::VectorXd End(const Row& row) {
  return (Eigen::VectorXd(row.transition.q.size() + row.transition.v.size()) << row.transition.next_q, row.transition.next_v)
      .finished();
}

// Standard deviation of each coordinate of s over the table; NaN where it was never observed.
Eigen::VectorXd Spread(const std::vector<Row>& rows) {
  const Eigen::Index n = Start(rows[0]).size();
  Eigen::VectorXd mean = Eigen::VectorXd::Zero(n), squares = mean, count = mean;
  for (const Row& row : rows) {
    const Eigen::VectorXd s = Start(row);
    for (Eigen::Index i = 0; i < n; ++i) {
      if (std::isnan(s(i))) continue;
      const double from_mean = s(i) - mean(i);
      mean(i) += from_mean / ++count(i);
      squares(i) += from_mean * (s(i) - mean(i));
    }
  }
  return (squares.array() / count.array()).sqrt();
}

// How a row goes on in the next one.
struct Link {
  bool linked = false;   // they are of one stretch
  bool shared = false;   // the end of the one is, as a reading, the beginning of the other
  double interval = kNaN;  // [s] from the one to the other
};

bool Near(const Row& row, const Row& next, const Eigen::VectorXd& within) {
  const Eigen::ArrayXd distance = (End(row) - Start(next)).array().abs();
  bool compared = false;
  for (Eigen::Index i = 0; i < distance.size(); ++i) {
    if (std::isnan(distance(i))) continue;
    if (!(distance(i) <= within(i))) return false;
    compared = true;
  }
  return compared;
}

// Links of rows that have an end of their own. That a state happens to be near what the row before led to says nothing in a
// table of unconnected transitions: most of the rows must be like that.
std::vector<Link> LinksByState(const std::vector<Row>& rows) {
  const Eigen::VectorXd within = kNearlyTheSame * Spread(rows), nothing = Eigen::VectorXd::Zero(within.size());
  std::vector<Link> links(rows.size());
  int64_t successive = 0, near = 0;
  for (size_t i = 0; i + 1 < rows.size(); ++i) {
    if (rows[i].ends || rows[i + 1].t < rows[i].t) continue;
    ++successive;
    const bool same = Near(rows[i], rows[i + 1], nothing);
    links[i] = {same || Near(rows[i], rows[i + 1], within), same, rows[i + 1].t - rows[i].t};
    near += links[i].linked;
  }
  if (2 * near < successive) {
    for (Link& link : links) link.linked = link.shared;
  }
  return links;
}

// Links of rows whose end is the next row's beginning, which this writes into them.
std::vector<Link> LinksByTime(std::vector<Row>& rows) {
  std::vector<Link> links(rows.size());
  for (size_t i = 0; i + 1 < rows.size(); ++i) {
    if (rows[i].ends || rows[i + 1].t < rows[i].t) continue;
    rows[i].transition.next_q = rows[i + 1].transition.q;
    rows[i].transition.next_v = rows[i + 1].transition.v;
    links[i] = {true, true, rows[i + 1].t - rows[i].t};
  }
  return links;
}

/// Rows to transitions, one after the other.
class Assembly {
 public:
  Assembly(const RobotDescription& robot, bool has_next, Log* log)
      : period_(robot.task.period), latency_(robot.simulation.latency), has_next_(has_next), log_(*log) {}

  void Take(std::vector<Row>& rows, const std::vector<Link>& links) {
    const Link none;
    Rollout rollout;
    const auto finish = [&] {
      if (!rollout.transitions.empty()) log_.rollouts.push_back(std::move(rollout));
      rollout = {};
    };
    for (size_t i = 0, first = 0; i < rows.size(); ++i) {
      const Link& before = i > 0 ? links[i - 1] : none;
      if (!before.linked || IsLate(before.interval)) {
        finish();
        first = i;
      }
      Row& row = rows[i];
      row.transition.step = static_cast<int>(i - first);
      const Eigen::VectorXd* effort_before = before.linked ? &rows[i - 1].effort : nullptr;
      if (!Complete(row, effort_before, before, links[i])) continue;
      rollout.episode = static_cast<int64_t>(log_.rollouts.size());
      rollout.transitions.push_back(std::move(row.transition));
    }
    finish();
  }

  /// [s] from row to row where that was not a control period: the median.
  double late_interval() {
    const auto middle = late_.begin() + static_cast<std::ptrdiff_t>(late_.size() / 2);
    std::nth_element(late_.begin(), middle, late_.end());
    return *middle;
  }

 private:
  bool IsLate(double interval) const { return std::abs(interval - period_) > kPeriodTolerance * period_; }

  bool Complete(Row& row, const Eigen::VectorXd* effort_before, const Link& before, const Link& after) {
    if (!after.linked && !has_next_) return false;  // where it leads is not told
    // The last row of a stretch goes at the pace of those before.
    const double interval = after.linked ? after.interval : before.linked ? before.interval : period_;
    if (IsLate(interval)) {
      ++log_.drops.late;
      late_.push_back(interval);
      return false;
    }
    const double duration =
        !after.linked || std::abs(interval - period_) <= kSamePeriod * period_ ? period_ : interval;
    Transition& t = row.transition;
    if (latency_ > 0) {
      t.efforts.push_back({std::min(latency_, duration),
                           effort_before ? *effort_before : Eigen::VectorXd::Zero(row.effort.size()).eval()});
    }
    if (duration > latency_) t.efforts.push_back({duration - std::max(latency_, 0.0), row.effort});
    const bool known = t.q.allFinite() && t.v.allFinite() &&
                       std::all_of(t.efforts.begin(), t.efforts.end(), [](const auto& e) { return e.effort.allFinite(); });
    if (!known || (t.next_q.array().isNaN().all() && t.next_v.array().isNaN().all())) {
      ++log_.drops.not_finite;
      return false;
    }
    const bool read = (before.linked && before.shared) || (after.linked && after.shared);
    t.q_sd.setConstant(t.q.size(), read ? kNaN : 0);
    t.v_sd.setConstant(t.v.size(), read ? kNaN : 0);
    t.next_q_sd.setConstant(t.q.size(), kNaN);
    t.next_v_sd.setConstant(t.v.size(), kNaN);
    return true;
  }

  double period_, latency_;
  bool has_next_;
  Log& log_;
  std::vector<double> late_;  // intervals
};

std::vector<std::string> Warnings(const std::vector<Row>& rows, const Names& names, int64_t clipped) {
  std::vector<std::string> warnings;
  const Eigen::VectorXd spread = Spread(rows);
  std::string still, missing;
  for (Eigen::Index i = 0; i < spread.size(); ++i) {
    const auto k = static_cast<size_t>(i);
    const std::string& name = k < names.q.size() ? names.q[k] : names.v[k - names.q.size()];
    if (std::isnan(spread(i))) missing += (missing.empty() ? "" : ", ") + name;
    if (spread(i) == 0 && rows.size() > 1) still += (still.empty() ? "" : ", ") + name;
  }
  if (!missing.empty()) warnings.push_back("never observed: " + missing);
  if (!still.empty()) warnings.push_back("the same in all rows: " + still);
  if (clipped > 0) warnings.push_back(fmt::format("{} actions go beyond the effort limits: clipped, as the task does", clipped));
  return warnings;
}

}  // namespace

Log ReadCsvLog(const std::string& file, const RobotDescription& robot) {
  CsvTable table(file);
  const Columns columns = FindColumns(table, robot);
  Efforts efforts(robot);
  std::vector<Row> rows = ReadRows(table, columns, efforts);
  if (rows.empty()) throw std::runtime_error(file + ": has a head but no rows");
  Log log{file, {}, {}, Warnings(rows, Names(robot), efforts.clipped())};
  Assembly assembly(robot, columns.has_next(), &log);
  assembly.Take(rows, columns.has_next() ? LinksByState(rows) : LinksByTime(rows));
  if (!log.rollouts.empty()) return log;
  std::string why;
  if (log.drops.total() == 0) {
    why = "no row is followed by another of its episode, and there are no next_ columns";
  } else if (log.drops.late == log.drops.total()) {
    why = fmt::format("its rows are {:.6g} s apart, but the task's control period is {:.6g} s", assembly.late_interval(),
                      robot.task.period);
  } else {
    why = log.drops.words();
  }
  throw std::runtime_error(file + ": no transition can be used: " + why);
}

}  // namespace plumb
