#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <string>
#include <vector>

#include "common/examples.h"
#include "common/lcm_url.h"
#include "common/process.h"
#include "common/realtime.h"
#include "drivers/driver_process.h"
#include "drivers/protocols/known_protocols.h"
#include "drivers/robot_bus.h"
#include "robot/description.h"

int main(int argc, char** argv) {
  std::string robot_path, flight_recorder;
  std::vector<std::string> buses;
  bool allow_unsigned = false;
  int priority = 0;
  bool is_virtual = false;
  return plumb::Run(
      "plumb-driver",
      "Drives a robot's motors on its CAN buses: JOINT_COMMAND in, JOINT_STATE out.", argc, argv,
      [&](CLI::App& app) {
        app.add_option("robot", robot_path, "robot folder, or its TOML file")->required();
        app.add_option("--bus", buses,
                       "socketcan:can0, udp:239.74.163.2:43113, of several NAME=URL; default: as "
                       "the robot says")
            ->allow_extra_args(false);
        app.add_option(
            "--flight-recorder", flight_recorder,
            fmt::format("folder: on every fault the frames of the last {} s are written there",
                        plumb::kFlightSeconds));
        app.add_flag("--virtual", is_virtual,
                     "the robot is plumb-robot: while no effort is sent, its positions may jump");
        app.add_flag("--unsigned", allow_unsigned, "obey anybody, although LCM leaves this machine")
            ->excludes(app.get_option("--key"));
        plumb::AddRealtimeFlag(app, priority);
        plumb::AddExamples(app, {"plumb-driver robots/hopper --bus socketcan:can0 "
                                 "--realtime-priority 80 --key robot.key"});
      },
      [&](plumb::Process& process) {
        plumb::RobotDescription robot = plumb::LoadRobot(robot_path);
        plumb::RequireProtocols(robot);
        plumb::SetUrls(robot.buses, buses);
        plumb::RequireKey(process.lcm_url(), !process.key_file().empty(), allow_unsigned);
        // LCM's thread comes right behind the cycle: what it brings is part of it.
        process.BecomeFast(std::max(priority - 1, 0));
        plumb::DriverProcess driver(process, robot, flight_recorder, is_virtual);
        process.BecomeFast(priority);
        return driver.Run();
      });
}
