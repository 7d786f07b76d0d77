#include "calibrator/motion/csv_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "calibrator/motion/differences.h"
#include "calibrator/motion/motion_table.h"
#include "calibrator/motion/table_units.h"
#include "common/median.h"
#include "common/special_numbers.h"

namespace plumb {
namespace {

// decimal fractions in binary: the period itself was meant
constexpr double kSamePeriod = 1e-6;
// of the spread of s: no further from what the row before led to
constexpr double kNearlyTheSame = 0.2;
constexpr double kFarthestNoise = 7;  // [sd] of the noise that most rows show

Eigen::VectorXd Start(const MotionRow& row) {
  return (Eigen::VectorXd(row.transition.q.size() + row.transition.v.size()) << row.transition.q,
          row.transition.v)
      .finished();
}
Eigen::VectorXd End(const MotionRow& row) {
  return (Eigen::VectorXd(row.transition.q.size() + row.transition.v.size())
              << row.transition.next_q,
          row.transition.next_v)
      .finished();
}

// How a row goes on in the next one.
struct Link {
  bool linked = false;     // they are of one stretch
  bool shared = false;     // the end of the one is, as a reading, the beginning of the other
  double interval = kNaN;  // [s] from the one to the other
};

bool Near(const MotionRow& row, const MotionRow& next, const Eigen::VectorXd& within) {
  const Eigen::ArrayXd distance = (End(row) - Start(next)).array().abs();
  bool compared = false;
  for (Eigen::Index i = 0; i < distance.size(); ++i) {
    if (std::isnan(distance(i))) continue;
    if (!(distance(i) <= within(i))) return false;
    compared = true;
  }
  return compared;
}

// How far from what the row before led to a state may be, coordinate by coordinate; empty if the
// rows of the table do not follow each other: that a state happens to be near says nothing among
// unconnected transitions, so in most coordinates most of the rows must be near. Then what keeps
// them apart is noise, and may be larger than the spread of a joint that hardly moves.
Eigen::VectorXd Tolerance(const std::vector<MotionRow>& rows) {
  const Eigen::VectorXd near = kNearlyTheSame * Spread(rows);
  Eigen::VectorXd within = near;
  int64_t connected = 0, compared = 0;
  for (Eigen::Index c = 0; c < near.size(); ++c) {
    std::vector<double> distances;
    for (size_t i = 0; i + 1 < rows.size(); ++i) {
      if (rows[i].ends || rows[i + 1].t < rows[i].t) continue;
      const double distance = std::abs(End(rows[i])(c) - Start(rows[i + 1])(c));
      if (std::isfinite(distance)) distances.push_back(distance);
    }
    const double median = Median(std::move(distances));
    if (std::isnan(median)) continue;
    ++compared;
    connected += median <= near(c);
    within(c) = std::max(near(c), kFarthestNoise * kSdOverMedianDeviation * median);
  }
  if (2 * connected < compared) return {};
  return within;
}

// Links of rows that have an end of their own.
std::vector<Link> LinksByState(const std::vector<MotionRow>& rows) {
  const Eigen::VectorXd within = Tolerance(rows);
  std::vector<Link> links(rows.size());
  for (size_t i = 0; i + 1 < rows.size(); ++i) {
    if (rows[i].ends || rows[i + 1].t < rows[i].t) continue;
    const bool same = Near(rows[i], rows[i + 1], Eigen::VectorXd::Zero(Start(rows[i]).size()));
    links[i] = {same || (within.size() > 0 && Near(rows[i], rows[i + 1], within)), same,
                rows[i + 1].t - rows[i].t};
  }
  return links;
}

// Links of rows whose end is the next row's beginning, which this writes into them.
std::vector<Link> LinksByTime(std::vector<MotionRow>& rows) {
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
      : period_(robot.task.period),
        latency_(robot.simulation.latency),
        has_next_(has_next),
        log_(*log) {}

  void Take(std::vector<MotionRow>& rows, const std::vector<Link>& links) {
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
      MotionRow& row = rows[i];
      row.transition.step = static_cast<int>(i - first);
      const Eigen::VectorXd* effort_before = before.linked ? &rows[i - 1].effort : nullptr;
      if (!Complete(row, effort_before, before, links[i])) continue;
      rollout.episode = static_cast<int64_t>(log_.rollouts.size());
      rollout.transitions.push_back(std::move(row.transition));
    }
    finish();
  }

  /// [s] from row to row where that was not a control period: the median.
  double late_interval() const { return Median(late_); }

 private:
  bool IsLate(double interval) const {
    return std::abs(interval - period_) > kPeriodTolerance * period_;
  }

  bool Complete(MotionRow& row, const Eigen::VectorXd* effort_before, const Link& before,
                const Link& after) {
    if (!after.linked && !has_next_) return false;  // where it leads is not told
    // The last row of a stretch goes at the pace of those before.
    const double interval = after.linked    ? after.interval
                            : before.linked ? before.interval
                                            : period_;
    if (IsLate(interval)) {
      ++log_.drops.late;
      late_.push_back(interval);
      return false;
    }
    // After a gap the effort that acts until the action does is unknown.
    if (latency_ > 0 && before.linked && IsLate(before.interval)) {
      ++log_.drops.gap;
      return false;
    }
    const double duration =
        !after.linked || std::abs(interval - period_) <= kSamePeriod * period_ ? period_ : interval;
    Transition& t = row.transition;
    if (latency_ > 0) {
      t.efforts.push_back(
          {std::min(latency_, duration),
           effort_before ? *effort_before : Eigen::VectorXd::Zero(row.effort.size()).eval()});
    }
    if (duration > latency_) t.efforts.push_back({duration - std::max(latency_, 0.0), row.effort});
    const bool known = t.q.allFinite() && t.v.allFinite() &&
                       std::all_of(t.efforts.begin(), t.efforts.end(),
                                   [](const auto& e) { return e.effort.allFinite(); });
    if (!known || (t.next_q.array().isNaN().all() && t.next_v.array().isNaN().all())) {
      ++log_.drops.not_finite;
      return false;
    }
    const bool read = (before.linked && before.shared) || (after.linked && after.shared);
    t.q_sd.setConstant(t.v.size(), read ? kNaN : 0);
    t.v_sd.setConstant(t.v.size(), read ? kNaN : 0);
    t.next_q_sd.setConstant(t.v.size(), kNaN);
    t.next_v_sd.setConstant(t.v.size(), kNaN);
    return true;
  }

  double period_, latency_;
  bool has_next_;
  Log& log_;
  std::vector<double> late_;  // intervals
};

// Which joints' velocities nobody has read, and what that means.
void TellVelocities(const RobotDescription& robot, bool in_table, Log* log) {
  if (in_table) {
    log->differenced = DifferencedJoints(robot, log->rollouts);
    if (!log->differenced.empty()) log->warnings.push_back(DifferencesWarning(log->differenced));
    return;
  }
  for (const JointDescription& joint : robot.joints) log->differenced.push_back(joint.name);
  log->warnings.push_back(
      "has no v/ columns: auto, laplace and mixture use positions alone; other methods take their "
      "differences for velocities, and intervals will be too narrow");
}

}  // namespace

Log ReadCsvLog(const std::string& file, const RobotDescription& robot) {
  MotionTable table = ReadMotionTable(file, robot);
  if (table.rows.empty()) throw std::runtime_error(file + ": has a head but no rows");
  return JoinMotion(file, std::move(table), robot);
}

Log JoinMotion(const std::string& name, MotionTable table, const RobotDescription& robot) {
  Log log{name, {}, {}, std::move(table.warnings)};
  const std::vector<Link> links =
      table.has_next ? LinksByState(table.rows) : LinksByTime(table.rows);
  Assembly assembly(robot, table.has_next, &log);
  assembly.Take(table.rows, links);
  if (!log.rollouts.empty()) {
    TellVelocities(robot, table.has_velocities, &log);
    if (robot.simulation.latency > 0) {
      log.warnings.push_back(
          fmt::format("the command of a row acts from {:g} ms after it on, as [simulation] latency "
                      "says",
                      1e3 * robot.simulation.latency));
    }
    return log;
  }
  std::string why;
  if (log.drops.total() == 0) {
    why = "no row is followed by another of its episode, and there are no next_ columns";
  } else if (log.drops.late == log.drops.total()) {
    why = fmt::format("its rows are {:.6g} s apart, but the task's control period is {:.6g} s",
                      assembly.late_interval(), robot.task.period);
    const std::string question = AskTimeUnit(assembly.late_interval(), robot.task.period);
    if (!question.empty()) why += ": " + question;
  } else {
    why = log.drops.summary();
  }
  throw std::runtime_error(name + ": no transition can be used: " + why);
}

}  // namespace plumb
