#include <iostream>

#include "cli/can.h"
#include "cli/command.h"
#include "cli/doctor.h"
#include "cli/export.h"
#include "cli/launch.h"
#include "cli/meldis.h"
#include "cli/record.h"
#include "cli/replay.h"
#include "cli/request.h"
#include "cli/tune.h"
#include "common/not_empty.h"
#include "common/realtime.h"
#include "common/seed_range.h"
#include "common/signature.h"
#include "plumb/driver_request_t.hpp"

namespace plumb {
namespace {

constexpr char kRobot[] = "robot folder or TOML file";

void AddDoctor(CLI::App& app, Action& action) {
  const auto buses = std::make_shared<std::vector<std::string>>(
      std::vector<std::string>{"udp:239.74.163.2:43113"});
  CLI::App* doctor = AddCommand(app, "doctor", "check that this machine is ready for a run");
  doctor->add_option("--bus", *buses, "CAN bus that is going to be used, may be repeated")
      ->allow_extra_args(false)
      ->capture_default_str();
  SetAction(*doctor, action, [buses](Process& process) {
    process.EndAtOnce();
    return Doctor(process.lcm_url(), *buses, process.key_file());
  });
}

void AddCan(CLI::App& app, Action& action) {
  CLI::App* can = AddCommand(app, "can", "the plan of the robot's CAN buses");
  can->require_subcommand(1);
  const auto robot = std::make_shared<std::string>(), bus = std::make_shared<std::string>(),
             output = std::make_shared<std::string>();
  CLI::App* plan =
      AddCommand(*can, "plan", "ids, load and response times; exit status 1 if it cannot work");
  plan->add_option("robot", *robot, kRobot)->required();
  SetAction(*plan, action, [robot] { return PrintBusPlan(*robot); });
  CLI::App* dbc = AddCommand(*can, "dbc", "all messages of a bus as a DBC file, for other tools");
  dbc->add_option("robot", *robot, kRobot)->required();
  dbc->add_option("--bus", *bus, "name of the bus; default: the only one");
  dbc->add_option("--output", *output, "file; default: print it");
  SetAction(*dbc, action, [robot, bus, output] { return WriteDbc(*robot, *bus, *output); });
}

void AddEstimate(CLI::App& app, Action& action) {
  CLI::App* estimate = AddCommand(app, "estimate", "settings of the estimator");
  estimate->require_subcommand(1);
  const auto robot = std::make_shared<std::string>(), log = std::make_shared<std::string>();
  CLI::App* tune = AddCommand(*estimate, "tune",
                              "infer the noise of sensors and motion from a log, for robot.toml");
  tune->add_option("robot", *robot, kRobot)->required();
  tune->add_option("--log", *log, "LCM log with JOINT_STATE and IMU")->required();
  SetAction(*tune, action, [robot, log] { return TuneEstimator(*robot, *log); });
}

void AddRequests(CLI::App& app, Action& action) {
  const auto request = [](int8_t what) {
    return [what](Process& process) { return RequestDriver(process, what); };
  };
  CLI::App* arm = AddCommand(app, "arm", "switch the motors on, also after a fault");
  const auto homed = std::make_shared<bool>(false);
  arm->add_flag("--homed", *homed,
                "joints whose drives have restarted are where their encoders say");
  SetAction(*arm, action, [homed](Process& process) {
    return RequestDriver(process, *homed ? driver_request_t::ARM_HOMED : driver_request_t::ARM);
  });
  SetAction(*AddCommand(app, "disarm", "switch the motors off"), action,
            request(driver_request_t::DISARM));
  SetAction(*AddCommand(app, "estop", "emergency stop"), action, request(driver_request_t::ESTOP));
}

void AddRecord(CLI::App& app, const std::string& line, Action& action) {
  const auto flags = std::make_shared<RecordFlags>();
  flags->command = line;
  CLI::App* record = AddCommand(app, "record", "record all messages to an LCM log, until Ctrl-C");
  record->add_option("file", flags->log, "the log; lcm-logplayer and --log read it")->required();
  record->add_flag("--overwrite", flags->overwrite, "write over what the log holds");
  record->add_option("--robot", flags->robot,
                     "robot folder or TOML file, of which a copy is kept beside the log");
  record->add_option("--note", flags->note, "what this is, kept beside the log");
  SetAction(*record, action, [flags](Process& process) { return Record(process, *flags); });
}

void AddReplay(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<ReplayFlags>();
  CLI::App* replay = AddCommand(
      app, "replay", "say on LCM what a log has, when it has it; keys pause, seek, change speed");
  replay->add_option("log", flags->log, "LCM log")->required();
  replay->add_option("--from", flags->part.from, "seconds from the log's beginning")
      ->check(CLI::Range(0.0, 1e9))
      ->capture_default_str();
  replay->add_option("--to", flags->part.to, "default: to the end")->check(CLI::Range(0.0, 1e9));
  replay
      ->add_option("--speed", flags->speed,
                   "times the log's own; 0 = as fast as all who listen on this machine can")
      ->check(CLI::Range(0.0, 1000.0))
      ->capture_default_str();
  replay->add_flag("--loop", flags->part.again, "again and again");
  SetAction(*replay, action, [flags](Process& process) { return Replay(process, *flags); });
}

void AddExport(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<ExportFlags>();
  CLI::App* export_log = AddCommand(
      app, "export", "write what a log has for Foxglove, Lichtblick, PlotJuggler, spreadsheets");
  export_log->add_option("log", flags->log, "LCM log")->required();
  auto* mcap = export_log->add_option("--mcap", flags->mcap,
                                      "an MCAP file: messages in JSON, and the robot in pictures");
  export_log->add_option("--csv", flags->csv, "a folder: a table for each channel");
  export_log
      ->add_option("--robot", flags->robot,
                   "robot folder or TOML file; default: the one beside the log")
      ->needs(mcap);
  SetAction(*export_log, action, [flags] { return Export(*flags); });
}

void AddMeldis(CLI::App& app, Action& action) {
  const auto robot = std::make_shared<std::string>();
  CLI::App* meldis = AddCommand(
      app, "meldis", "say what Drake's meldis draws of the state that is heard, until Ctrl-C");
  meldis->add_option("robot", *robot, kRobot)->required();
  SetAction(*meldis, action, [robot](Process& process) { return ShowInMeldis(process, *robot); });
}

void AddKey(CLI::App& app, Action& action) {
  const auto file = std::make_shared<std::string>();
  CLI::App* key = AddCommand(app, "key", "make a key to sign commands with");
  key->add_option("file", *file, "a new file, which only its owner may read")->required();
  SetAction(*key, action, [file](Process&) {
    MakeKeyFile(*file);
    std::cout << *file
              << ": a new key; copy it to whatever may command the robot, and let nobody else "
                 "read it"
              << std::endl;
    return 0;
  });
}

/// What is learnt, of which robot, and how long.
void AddLoopFlags(CLI::App& launch, LaunchFlags& flags) {
  launch.add_option("robot", flags.robot, "robot folder or TOML file")->capture_default_str();
  launch.add_option("--seed", flags.seed, "of all random numbers and of the hidden robot")
      ->check(SeedRange())
      ->capture_default_str();
  auto* iterations = launch.add_option("--iterations", flags.iterations, "of calibration")
                         ->check(CLI::Range(1, 1000))
                         ->capture_default_str();
  auto* episodes = launch
                       .add_option("--evaluation-episodes", flags.evaluation_episodes,
                                   "roll-outs of the final policy")
                       ->check(CLI::Range(1, 1000))
                       ->capture_default_str();
  auto* efforts =
      launch
          .add_option("--efforts", flags.efforts,
                      "instead of the loop: play this table of `plumb excite` once, calibrate")
          ->check(NotEmpty())
          ->excludes(iterations, episodes);
  launch
      .add_option("--policy", flags.policy,
                  "instead of the loop: run this policy, an ONNX model or a trainer's checkpoint")
      ->check(NotEmpty())
      ->excludes(iterations, efforts);
}

/// Which robot it is, a virtual or a real one, by which clock it moves, and whom it obeys.
/// @param key the flag with the key of whoever may be obeyed.
void AddRobotAndClockFlags(CLI::App& launch, CLI::Option* key, LaunchFlags& flags) {
  launch
      .add_option("--bus", flags.buses,
                  "CAN bus, e.g. socketcan:can0, of several NAME=URL; default: the robot's own")
      ->allow_extra_args(false);
  auto* real_time = launch.add_flag(
      "--real-time", flags.real_time,
      "a virtual robot by this machine's clock, as a real one; default: in virtual time");
  launch
      .add_option("--speed", flags.speed,
                  "in real time the clock's scale; in virtual time at most so many times "
                  "real time, 0 = no limit")
      ->check(CLI::Range(0.0, 100.0));
  AddRealtimeFlag(launch, flags.priority);
  launch
      .add_flag("--real", flags.real,
                "the robot itself is on the bus: no virtual one, ask before arming")
      ->excludes(real_time);
  launch
      .add_flag("--unsigned", flags.allow_unsigned,
                "let the driver obey anybody, although LCM leaves this machine")
      ->excludes(key);
}

/// What is recorded of it. After AddRobotAndClockFlags.
void AddRecordingFlags(CLI::App& launch, LaunchFlags& flags) {
  launch.add_option("--log", flags.log, "record all messages to this LCM log");
  launch.add_flag("--overwrite", flags.overwrite,
                  "write over a log of messages or frames that no run in virtual time of this "
                  "robot would make again");
  launch
      .add_option("--can-log", flags.can_log,
                  "in virtual time: record all frames to this file, as candump -l does")
      ->excludes(launch.get_option("--real-time"), launch.get_option("--real"));
}

/// Who looks on.
void AddDashboardFlags(CLI::App& launch, LaunchFlags& flags) {
  auto* dashboard =
      launch
          .add_option("--dashboard", flags.dashboard,
                      "show the run in browsers; where to listen, default: 127.0.0.1:8765")
          ->expected(0, 1)
          ->type_name("ADDRESS:PORT");
  launch
      .add_option("--origin", flags.origins,
                  "of another page that may talk to the dashboard, as Foxglove's, "
                  "https://app.foxglove.dev; may be repeated")
      ->allow_extra_args(false)
      ->needs(dashboard);
}

/// What is left of it.
void AddOutcomeFlags(CLI::App& launch, LaunchFlags& flags) {
  launch.add_option("--summary", flags.summary, "write the outcome to this JSON file");
  launch.add_option("--report", flags.report, "how it went, for people: an HTML page");
  launch.add_option("--output", flags.output,
                    "folder for logs and checkpoints; default: a new one in runs/");
}

}  // namespace

void AddLaunch(CLI::App& app, const std::string& line, Action& action) {
  const auto flags = std::make_shared<LaunchFlags>();
  flags->command = line;
  CLI::App* launch =
      AddCommand(app, "launch", "run the whole loop: train, roll out, calibrate, train ...");
  AddLoopFlags(*launch, *flags);
  AddRobotAndClockFlags(*launch, app.get_option("--key"), *flags);
  AddRecordingFlags(*launch, *flags);
  AddDashboardFlags(*launch, *flags);
  AddOutcomeFlags(*launch, *flags);
  const auto launches = [flags, launch](Process& process) {
    if (launch->count("--dashboard") > 0 && flags->dashboard.empty())
      flags->dashboard = "127.0.0.1:8765";
    return Launch(process, *flags);
  };
  SetAction(*launch, action, launches, [flags]() -> std::string {
    if (flags->priority != 0 && !flags->real_time && !flags->real)
      return "--realtime-priority needs --real-time or --real: in virtual time there are no "
             "priorities";
    if (flags->overwrite && flags->log.empty() && flags->can_log.empty())
      return "--overwrite needs --log or --can-log";
    return "";
  });
}

void AddRobotCommands(CLI::App& app, const std::string& line, Action& action) {
  AddDoctor(app, action);
  AddCan(app, action);
  AddEstimate(app, action);
  AddRequests(app, action);
  AddRecord(app, line, action);
  AddReplay(app, action);
  AddExport(app, action);
  AddMeldis(app, action);
  AddKey(app, action);
}

}  // namespace plumb
