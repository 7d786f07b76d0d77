#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "robot/description.h"
#include "sim/tasks/task.h"

namespace plumb {

/// The metadata of a policy file: the robot and task that the policy is for, and its origin. All
/// functions of this header are thread-safe.
struct PolicyRecord {
  std::string robot, task;  ///< names, as in robot.toml
  /// Task::observation_names: what the policy sees, in order
  std::vector<std::string> observation_names;
  std::vector<std::string> action_names;  ///< Task::action_names: the driven joints, in order
  std::vector<std::string> action_units;  ///< of their efforts: "Nm", or "N" for a slide
  double period = 0;                      ///< [s] > 0, from one action to the next
  /// which distribution of simulators it was trained on
  std::string posterior = "prior";
  /// of the program that trained it, with its git hash
  std::string version;
  uint64_t seed = 0;  ///< of the training's random numbers
  int64_t steps = 0;  ///< control steps simulated for it, >= 0
  /// mean return of the last batch, undiscounted, with exploration
  std::optional<double> training_return;
  /// Figures on simulators that training has not seen, finite, e.g. {{"mean_return", -151.3},
  /// {"episodes", 100}}.
  std::map<std::string, double> evaluation;

  bool operator==(const PolicyRecord&) const = default;
};

/// The record of a policy for this robot and task, made by this program; how it was trained is the
/// caller's to fill in.
PolicyRecord MakePolicyRecord(const RobotDescription& robot, const Task& task);

/// @throws std::invalid_argument saying what differs, if the policy was trained for another robot,
/// task, observations, actions or control period.
void RequireSameTask(const PolicyRecord& record, const RobotDescription& robot, const Task& task);

/// As named texts, the form in which a file keeps it: numbers so that they read back to the same
/// bits; lists and `evaluation` as JSON; what is not known is left out. docs/policy.md lists the
/// names.
std::map<std::string, std::string> ToProperties(const PolicyRecord& record);
/// Names it does not know are ignored. @throws std::invalid_argument naming the property that is
/// missing or wrong.
PolicyRecord FromProperties(const std::map<std::string, std::string>& properties);

}  // namespace plumb
