#include "cli/can.h"

#include <fmt/format.h>

#include <algorithm>
#include <iostream>
#include <stdexcept>

#include "cli/outputs.h"
#include "common/atomic_file.h"
#include "drivers/bus/bus_plan.h"
#include "drivers/bus/dbc.h"
#include "drivers/protocols/known_protocols.h"
#include "robot/description.h"

namespace plumb {

namespace {

size_t BusNamed(const std::vector<BusDescription>& buses, const std::string& name) {
  if (name.empty() && buses.size() == 1) return 0;
  const auto bus = std::ranges::find(buses, name, &BusDescription::name);
  if (bus != buses.end()) return static_cast<size_t>(bus - buses.begin());
  throw std::invalid_argument(
      fmt::format("--bus \"{}\" is none of the robot's: {}", name, InOneLine(buses)));
}

}  // namespace

int PrintBusPlan(const std::string& robot) {
  const RobotDescription description = LoadRobot(robot);
  RequireProtocols(description);
  bool works = true;
  for (size_t i = 0; i < description.buses.size(); ++i) {
    const BusDescription& bus = description.buses[i];
    const BusPlan plan = PlanBus(description, i);
    std::cout << (i == 0 ? "" : "\n") << description.name
              << (bus.name.empty() ? "" : ", " + bus.Label() + ",") << " on " << bus.url << "\n"
              << ToText(plan);
    works = works && plan.errors.empty();
  }
  std::cout << std::flush;
  return works ? 0 : 1;
}

int WriteDbc(const std::string& robot, const std::string& bus, const std::string& output) {
  const RobotDescription description = LoadRobot(robot);
  RequireProtocols(description);
  RequireOutputs({output}, FilesOf(description));
  const std::string text = ToDbc(BusDevices(description, BusNamed(description.buses, bus)));
  if (output.empty()) {
    std::cout << text << std::flush;
  } else {
    WriteAtomically(output, text);
  }
  return 0;
}

}  // namespace plumb
