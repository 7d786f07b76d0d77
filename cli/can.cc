#include "cli/can.h"

#include <iostream>

#include "cli/outputs.h"
#include "common/atomic_file.h"
#include "drivers/bus/bus_plan.h"
#include "drivers/bus/dbc.h"
#include "robot/description.h"

namespace plumb {

int PrintBusPlan(const std::string& robot) {
  const RobotDescription description = LoadRobot(robot);
  const BusPlan plan =
      PlanBus(BusDevices(description), description.bus_bit_rate, description.bus_data_bit_rate);
  std::cout << description.name << " on " << description.bus_url << "\n"
            << ToText(plan) << std::flush;
  return plan.errors.empty() ? 0 : 1;
}

int WriteDbc(const std::string& robot, const std::string& output) {
  const RobotDescription description = LoadRobot(robot);
  RequireOutputs({output}, FilesOf(description));
  const std::string text = ToDbc(BusDevices(description));
  if (output.empty()) {
    std::cout << text << std::flush;
  } else {
    WriteAtomically(output, text);
  }
  return 0;
}

}  // namespace plumb
