#include "sim/tasks/effort_table.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>
#include <vector>

#include "common/csv_reader.h"
#include "common/nearest_name.h"

namespace plumb {
namespace {

constexpr double kSamePeriod = 0.01, kRounding = 1e-9;
constexpr size_t kMostRows = 10'000'000;  // a day at 100 Hz

int Column(const CsvReader& table, const std::string& name) {
  const int column = table.Find(name);
  if (column < 0) {
    table.Fail(fmt::format("has no column '{}'; the nearest is {}", name,
                           Quoted(NearestName(name, table.names()))));
  }
  return column;
}

}  // namespace

Eigen::MatrixXf ReadEffortTable(const std::string& file, const RobotDescription& robot,
                                const Task& task) {
  CsvReader table(file);
  const int time = Column(table, "t");
  std::vector<int> columns;
  for (const std::string& joint : task.action_names())
    columns.push_back(Column(table, "u/" + joint));
  const Eigen::VectorXd limits = robot.effort_limits();
  std::vector<float> actions;
  double before = NAN;
  while (table.Next()) {
    const double t = table.Number(time);
    if (std::isnan(t)) table.Fail("t must be known");
    if (!std::isnan(before) &&
        !(std::abs(t - before - robot.task.period) <= kSamePeriod * robot.task.period)) {
      table.Fail(
          fmt::format("t is {}, {:.6g} s after the row before, but the control period is {} s", t,
                      t - before, robot.task.period));
    }
    before = t;
    for (size_t i = 0; i < columns.size(); ++i) {
      const int index = static_cast<int>(i);
      const double share = table.Number(columns[i]) * task.action_unit(index) / limits[index];
      if (!(std::abs(share) <= 1 + kRounding)) {
        table.Fail(fmt::format("u/{} is {}: beyond the joint's effort limit, or not known",
                               task.action_names()[i], table.Number(columns[i])));
      }
      actions.push_back(static_cast<float>(share));
    }
    if (actions.size() > kMostRows * columns.size())
      table.Fail("more rows than any excitation has");
  }
  if (actions.empty()) throw std::runtime_error(file + ": has a head but no rows");
  const auto joints = static_cast<Eigen::Index>(columns.size());
  using Rows = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  return Eigen::Map<const Rows>(actions.data(), static_cast<Eigen::Index>(actions.size()) / joints,
                                joints);
}

}  // namespace plumb
