#pragma once

#include <functional>
#include <string>

#include "common/process.h"

namespace CLI {
class App;
}

namespace plumb {

/// What a command does, once its options are known. @return exit status.
using Action = std::function<int(Process&)>;

// Commands of plumb with their options. The one that is given sets the action, which is to outlive
// the app's parsing. `line` is the whole command line, which results record. Not thread-safe.

void AddLaunch(CLI::App& app, const std::string& line, Action& action);
/// sim, calibrate, excite, train, export-model, serve-model: what needs no robot.
void AddSimulatorCommands(CLI::App& app, const std::string& line, Action& action);
/// doctor, can, estimate, arm, disarm, estop, record, replay, export, meldis, key.
void AddRobotCommands(CLI::App& app, const std::string& line, Action& action);

}  // namespace plumb
