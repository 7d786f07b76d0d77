#include "cli/roll_out.h"

#include <fmt/format.h>

#include <cmath>

#include "robot/coordinate_names.h"

namespace plumb {
namespace {

void AppendNumbers(const Eigen::VectorXd& numbers, std::string& csv) {
  for (const double number : numbers) csv += fmt::format(",{:.17g}", number);
}

}  // namespace

std::string Totals(const std::vector<EpisodeSummary>& episodes) {
  const auto failed = [](const EpisodeSummary& episode) {
    return episode.end == EpisodeSummary::End::kNotFinite;
  };
  double sum = 0, squares = 0, count = 0;
  int64_t steps = 0;
  for (const EpisodeSummary& episode : episodes) {
    steps += episode.steps;
    if (!failed(episode)) sum += episode.sum, ++count;
  }
  for (const EpisodeSummary& episode : episodes) {
    if (!failed(episode)) squares += std::pow(episode.sum - sum / count, 2);
  }
  std::string text = fmt::format("{} episode{}, {} steps", episodes.size(),
                                 episodes.size() == 1 ? "" : "s", steps);
  if (count > 0) text += fmt::format(", mean return {:.1f}", sum / count);
  if (count > 1)
    text += fmt::format(", standard deviation {:.1f}", std::sqrt(squares / (count - 1)));
  const size_t failures = episodes.size() - static_cast<size_t>(count);
  if (failures > 0) {
    text += fmt::format("; {} failed: the simulation has blown up{}", failures,
                        count > 0 ? ", left out of the mean" : "");
  }
  return text;
}

std::string CsvHeader(const RobotDescription& robot) {
  const CoordinateNames names(robot);
  std::string header = "t";
  for (const std::string& name : names.q) header += ",q/" + name;
  for (const std::string& name : names.v) header += ",v/" + name;
  for (const JointDescription& joint : robot.joints) {
    if (!joint.passive) header += ",u/" + joint.name;
  }
  return header + ",reward,terminated,truncated\n";
}

void AppendCsv(const SimulatedStep& step, std::string& csv) {
  csv += fmt::format("{:.17g}", step.time);
  AppendNumbers(step.q, csv);
  AppendNumbers(step.v, csv);
  AppendNumbers(step.action, csv);
  csv += fmt::format(",{:.17g},{:d},{:d}\n", step.reward, step.terminated, step.truncated);
}

}  // namespace plumb
