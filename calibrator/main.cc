// plumb-calibrator: ROBOT_STATE_SMOOTHED, JOINT_COMMAND, CONTROLLER_STATUS ->
// PARAMETER_DISTRIBUTION.

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>

#include <cstdint>
#include <iostream>
#include <stdexcept>
#include <string>

#include "calibrator/live/session.h"
#include "calibrator/motion/motion_log.h"
#include "calibrator/motion/recorded_robot.h"
#include "common/examples.h"
#include "common/messenger.h"
#include "common/process.h"
#include "common/seed_range.h"
#include "robot/description.h"

namespace plumb {
namespace {

struct Flags {
  std::string robot;
  std::string log;
  CalibrationSession::Settings session{.folder = "calibration"};
};

int RunLive(Process& process, CalibrationSession& session, const RobotDescription& robot) {
  Messenger& messenger = process.messenger();
  messenger.Follow(robot.name);
  Publisher<parameter_distribution_t> distribution(messenger, "PARAMETER_DISTRIBUTION");
  Publisher<calibration_status_t> status(messenger, "CALIBRATION_STATUS");
  Subscriber<robot_state_t> states(messenger, "ROBOT_STATE_SMOOTHED", [&](const robot_state_t& m) {
    session.calibrator().OnState(m);
  });
  Subscriber<joint_command_t> commands(messenger, "JOINT_COMMAND", [&](const joint_command_t& m) {
    session.calibrator().OnCommand(m);
  });
  Subscriber<controller_status_t> controller(
      messenger, "CONTROLLER_STATUS",
      [&](const controller_status_t& m) { session.calibrator().OnControllerStatus(m); });
  const auto publish = [&] {
    distribution.Publish(session.Distribution());
    status.Publish(session.Status());
  };
  publish();
  constexpr int64_t kLook = 50'000, kRepeat = 1'000'000;  // [us]
  int64_t last = process.clock().Now();
  const auto stream = [&] { session.Stream(); };
  while (session.busy() ? process.Sleep(0) : process.Sleep(kLook, stream)) {
    states.Rethrow(), commands.Rethrow(), controller.Rethrow();
    const bool complete = session.Work();
    if (complete) process.TakeVirtualTime(robot.calibration.duration);
    if (complete || process.clock().Now() - last >= kRepeat) {
      publish();
      last = process.clock().Now();
    }
  }
  const int64_t rejected = states.rejected() + commands.rejected() + controller.rejected();
  if (rejected > 0) spdlog::warn("{} messages did not decode", rejected);
  return 0;
}

void PrintIteration(const calibration_status_t& m, const RobotDescription& robot) {
  std::string line = fmt::format("{:3d} ", m.iteration);
  for (size_t i = 0; i < m.mean.size(); ++i) {
    line += fmt::format("  {} {:.4f} ± {:.4f}", robot.parameters[i].name, m.mean[i], m.sd[i]);
  }
  line += fmt::format("  discrepancy {:.3f}  KL {:.3f}  ESS {:.1f}", m.discrepancy, m.kl, m.ess);
  std::cout << line << std::endl;
}

int RunLog(Process& process, CalibrationSession& session, const RobotDescription& robot,
           const std::string& file) {
  for (const std::string& warning : CheckRecordedRobot(file, robot)) spdlog::warn("{}", warning);
  const MotionCounts counts = ReadMotion(file, session.calibrator(), [&] {
    while (session.busy() && !process.stopping()) {
      if (session.Work()) PrintIteration(session.Status(), robot);
    }
    return !process.stopping();
  });
  if (process.stopping()) return 130;
  const calibration_status_t found = session.Status();
  spdlog::info("{} events, {} undecodable; dropped transitions: {}", counts.events,
               counts.undecodable, session.calibrator().drops().summary());
  if (found.iteration == 0)
    throw std::runtime_error(file + ": holds no complete roll-out to calibrate with");
  std::cout << found.identifiability << std::endl;
  return 0;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  plumb::Flags flags;
  return plumb::Run(
      "plumb-calibrator", "Learns which simulators could have produced the robot's motion.", argc,
      argv,
      [&](CLI::App& app) {
        app.add_option("robot", flags.robot, "robot folder or TOML file")->required();
        app.add_option("--log", flags.log,
                       "calibrate from this LCM log instead of live messages, and exit");
        app.add_option("--method", flags.session.method,
                       "of inference; default: as robot.toml says")
            ->check(CLI::IsMember(plumb::LiveMethods()));
        app.add_option("--seed", flags.session.seed, "of the random numbers")
            ->check(plumb::SeedRange())
            ->capture_default_str();
        app.add_option("--checkpoint", flags.session.folder,
                       "folder for checkpoints and posterior_<iteration>.json")
            ->capture_default_str();
        app.add_option("--threads", flags.session.threads,
                       "0 = one per core; the result does not depend on it")
            ->check(CLI::Range(0, 1024))
            ->capture_default_str();
        plumb::AddExamples(app, {"plumb-calibrator robots/pendulum --checkpoint run"});
      },
      [&](plumb::Process& process) {
        const plumb::RobotDescription robot = plumb::LoadRobot(flags.robot);
        flags.session.anew = process.begins_virtual_run();
        plumb::CalibrationSession session(robot, flags.session, process.clock());
        return flags.log.empty() ? plumb::RunLive(process, session, robot)
                                 : plumb::RunLog(process, session, robot, flags.log);
      });
}
