#include "cli/run_setting.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <ctime>
#include <stdexcept>

#include "cli/preflight.h"
#include "common/lcm_url.h"
#include "common/process_number.h"
#include "drivers/driver/driver.h"
#include "sim/parameters.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

// Says before anything starts what the driver would otherwise say in its log.
void RequireDrivable(const RobotDescription& robot) {
  try {
    Driver(robot, 0, 0);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(fmt::format("{} cannot be launched (plumb sim simulates it): {}",
                                            robot.name, error.what()));
  }
}

fs::path MakeFolder(const std::string& wanted) {
  const fs::path folder =
      wanted.empty() ? fs::path("runs") / fmt::format("{:%Y-%m-%d-%H%M%S}-{}",
                                                      fmt::localtime(std::time(nullptr)), getpid())
                     : fs::path(wanted);
  fs::create_directories(folder);
  return folder;
}

}  // namespace

RunSetting::RunSetting(const Process& process, const LaunchFlags& flags)
    : robot(LoadRobot(flags.robot)),
      bus(flags.bus.empty() ? robot.bus_url : flags.bus),
      run(flags.real || flags.real_time ? ProcessNumber(getpid()) : 0) {
  for (const std::string& warning : robot.warnings) spdlog::warn("{}", warning);
  RequireDrivable(robot);
  RequireKey(process.lcm_url(), !process.key_file().empty(), flags.allow_unsigned);
  if (flags.real && flags.speed != 0)
    throw std::invalid_argument("a real robot runs at its own speed, without --speed");
  if (!flags.real) truth = HiddenParameters(robot, flags.seed);
  RequireFree(process.lcm_url(), bus, flags.real);
  output = MakeFolder(flags.output);
  lock.emplace(output);
  if (flags.real || flags.real_time) return;
  virtual_run.emplace(output, process.lcm_url(), VirtualRun::Records{flags.log, flags.can_log});
  virtual_run->coordinator().max_speed = flags.speed;
}

}  // namespace plumb
