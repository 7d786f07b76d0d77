// plumb: the front door.

#include <CLI/CLI.hpp>

#include "cli/commands.h"
#include "cli/examples.h"

int main(int argc, char** argv) {
  std::string line = "plumb";
  for (int i = 1; i < argc; ++i) line += std::string(" ") + argv[i];
  plumb::Action action;
  return plumb::Run(
      "plumb", "Keeps a simulator plumb with its robot.", argc, argv,
      [&](CLI::App& app) {
        app.require_subcommand(1);
        plumb::AddLaunch(app, line, action);
        plumb::AddSimulatorCommands(app, line, action);
        plumb::AddRobotCommands(app, line, action);
        plumb::AddCommandExamples(app);
      },
      [&](plumb::Process& process) { return action(process); });
}
