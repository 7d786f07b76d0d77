// The list of tasks. A new task is its file pair, its line here, and its name in CMakeLists.txt.
#include <stdexcept>

#include "common/nearest_name.h"
#include "sim/tasks/balance.h"
#include "sim/tasks/hopper.h"
#include "sim/tasks/pendulum.h"
#include "sim/tasks/reach.h"
#include "sim/tasks/stand.h"
#include "sim/tasks/task.h"
#include "sim/tasks/walk.h"

namespace plumb {
namespace {

template <class T>
std::unique_ptr<Task> Make(const RobotDescription& description) {
  return std::make_unique<T>(description);
}

constexpr struct {
  const char* name;
  std::unique_ptr<Task> (*make)(const RobotDescription&);
} kTasks[] = {
    {"pendulum", Make<PendulumTask>},  // swing up
    {"hopper", Make<HopperTask>},      // hop forward
    {"reach", Make<ReachTask>},        // go to a target from anywhere
    {"hold", Make<HoldTask>},          // stay near a target
    {"balance", Make<BalanceTask>},    // and do not fall
    {"walk", Make<WalkTask>},          // on legs, at a commanded velocity
    {"stand", Make<StandTask>},        // on legs, after having been set down askew
};

}  // namespace

std::unique_ptr<Task> MakeTask(const RobotDescription& description) {
  const std::string& name = description.task.name;
  for (const auto& task : kTasks) {
    if (task.name == name) return task.make(description);
  }
  const std::string where = description.file.empty() ? "" : description.file + ": [task] ";
  throw std::invalid_argument(where + "no task is named '" + name + "'; the nearest is '" +
                              NearestName(name, TaskNames()) + "'");
}

std::vector<std::string> TaskNames() {
  std::vector<std::string> names;
  for (const auto& task : kTasks) names.emplace_back(task.name);
  return names;
}

}  // namespace plumb
