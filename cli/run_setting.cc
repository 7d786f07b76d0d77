#include "cli/run_setting.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <ctime>
#include <stdexcept>

#include "calibrator/live/checkpoint.h"
#include "calibrator/motion/transitions.h"
#include "cli/launch_report.h"
#include "cli/outputs.h"
#include "cli/preflight.h"
#include "common/atomic_file.h"
#include "common/lcm_url.h"
#include "common/listen_address.h"
#include "common/process_number.h"
#include "drivers/driver/driver.h"
#include "drivers/protocols/known_protocols.h"
#include "sim/parameters.h"
#include "sim/tasks/effort_table.h"
#include "trainer/checkpoint.h"
#include "trainer/session.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

// Says before anything starts what the driver would otherwise say in its log.
void RequireDrivable(const RobotDescription& robot) {
  try {
    RequireProtocols(robot);
    Driver(robot, 0, 0);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(fmt::format("{} cannot be launched (plumb sim simulates it): {}",
                                            robot.name, error.what()));
  }
}

// The calibrator would forget the beginning.
void RequireKept(const RobotDescription& robot, const std::string& efforts) {
  const double lasts = robot.task.steps * robot.task.period,
               kept = static_cast<double>(TransitionJoiner::kMaxStates) * robot.driver.cycle;
  if (lasts > kept) {
    throw std::invalid_argument(fmt::format(
        "{}: lasts {:.6g} s; of one motion {:.6g} s are kept to learn from: play several shorter "
        "ones",
        efforts, lasts, kept));
  }
}

fs::path MakeRunFolder(const std::string& wanted) {
  fs::path folder =
      wanted.empty() ? fs::path("runs") / fmt::format("{:%Y-%m-%d-%H%M%S}-{}",
                                                      fmt::localtime(std::time(nullptr)), getpid())
                     : fs::path(wanted);
  MakeFolder(folder);
  return folder;
}

void RequireProcessFiles(const Process& process, const LaunchFlags& flags,
                         const RobotDescription& robot) {
  std::vector<std::string> inputs = FilesOf(robot);
  inputs.insert(inputs.end(), {process.key_file(), flags.efforts, flags.policy});
  const std::vector<std::string> outputs{flags.log, flags.can_log, flags.summary, flags.report};
  RequireNotRead(outputs, inputs);
  RequireApart(outputs);
  RequireLcmLog(flags.log);
  if (!flags.overwrite)
    RequireOverwritable(flags.log, flags.real || flags.real_time ? "" : robot.name);
  RequireSameKind(flags.can_log, "(", "a log of candump's");
  // Its frames' dates begin where virtual time does.
  if (!flags.overwrite)
    RequireSameKind(flags.can_log, fmt::format("({}", Coordinator::kBeginning / 1'000'000'000),
                    "a run's in virtual time (--overwrite)");
  RequireSameKind(flags.summary, "{\n \"bus\": ", "a run's summary");
  RequireSameKind(flags.report, LaunchReportBegins(), "a report of ours");
}

// A run goes on from what is in its folder; what is another's is refused before anything starts.
void RequireOwn(const fs::path& folder, const RobotDescription& robot, const LaunchFlags& flags) {
  CalibrationCheckpoint(folder / kCalibrationFolder, robot, flags.seed).Load();
  const fs::path file = folder / kTrainingFolder / kTrainerCheckpoint;
  const std::optional<Checkpoint> training = LoadCheckpoint(file);
  if (!training) return;
  try {
    RequireContinues(*training, robot.fingerprint, flags.seed, flags.iterations);
  } catch (const CheckpointError& error) {
    throw CheckpointError(file.string() + ": " + error.what() + ": give another --output");
  }
}

}  // namespace

// Listening, as RequireFree does, tells nothing of who has just begun to listen, too. What stays
// within a process is nobody else's.
void RunSetting::Lock(const std::string& lcm_url) {
  if (!lcm_url.starts_with("memq:")) {
    locks.emplace_back("messages " + LcmGroup(lcm_url),
                       "another run is under way on " + lcm_url +
                           ": stop it, or give --lcm-url and another --bus: each run has its own");
  }
  for (const BusDescription& bus : robot.buses) {
    const std::string innermost = InnermostBus(bus.url);
    if (innermost.starts_with("loop:")) continue;
    locks.emplace_back("bus " + innermost, "another run is under way on " + innermost +
                                               ": stop it, or give another --bus");
  }
}

RunSetting::RunSetting(const Process& process, const LaunchFlags& flags)
    : robot(LoadRobot(flags.robot)),
      run(flags.real || flags.real_time ? ProcessNumber(getpid()) : 0) {
  SetUrls(robot.buses, flags.buses);
  for (const std::string& warning : robot.warnings) spdlog::warn("{}", warning);
  if (!flags.dashboard.empty()) ListenAddress::Parse(flags.dashboard);
  RequireDrivable(robot);
  if (!flags.efforts.empty()) {
    const Eigen::MatrixXf played = ReadEffortTable(flags.efforts, robot, *MakeTask(robot));
    robot.task.steps = static_cast<int>(played.rows());
    RequireKept(robot, flags.efforts);
  }
  if (flags.policy.empty())
    RequireSendable(robot);
  else
    LoadSendablePolicy(flags.policy, robot);
  RequireKey(process.lcm_url(), !process.key_file().empty(), flags.allow_unsigned);
  if (flags.real && flags.speed != 0)
    throw std::invalid_argument("a real robot runs at its own speed, without --speed");
  if (!flags.real) truth = HiddenParameters(robot, flags.seed);
  RequireProcessFiles(process, flags, robot);
  Lock(process.lcm_url());
  RequireFree(process.lcm_url(), robot.buses, flags.real);
  output = MakeRunFolder(flags.output);
  lock.emplace(output);
  if (flags.policy.empty()) RequireOwn(output, robot, flags);
  for (const std::string& file : {flags.summary, flags.report}) {
    if (!file.empty()) RequireWritable(file);  // perhaps in that folder
  }
  if (flags.real || flags.real_time) return;
  const RecordFolder::About about{VersionLine("plumb"), flags.command, "", "virtual", flags.robot};
  virtual_run.emplace(output, process.lcm_url(),
                      VirtualRun::Records{flags.log, about, flags.can_log, robot.buses});
  virtual_run->coordinator().max_speed = flags.speed;
}

}  // namespace plumb
