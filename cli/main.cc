// plumb: the front door.

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <iostream>

#include "cli/calibrate.h"
#include "cli/can.h"
#include "cli/doctor.h"
#include "cli/examples.h"
#include "cli/excite.h"
#include "cli/export.h"
#include "cli/launch.h"
#include "cli/meldis.h"
#include "cli/record.h"
#include "cli/replay.h"
#include "cli/request.h"
#include "cli/sim.h"
#include "cli/train.h"
#include "cli/tune.h"
#include "common/process.h"
#include "common/realtime.h"
#include "common/signature.h"
#include "plumb/driver_request_t.hpp"

namespace plumb {
namespace {

int MakeKey(const std::string& file) {
  MakeKeyFile(file);
  std::cout << file
            << ": a new key; copy it to whatever may command the robot, and let nobody else read it"
            << std::endl;
  return 0;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  plumb::LaunchFlags flags;
  plumb::SimFlags sim_flags;
  plumb::CalibrateFlags calibrate_flags;
  plumb::TrainFlags train_flags;
  plumb::RecordFlags record_flags;
  plumb::ReplayFlags replay_flags;
  plumb::ExportFlags export_flags;
  std::string command = "plumb";
  for (int i = 1; i < argc; ++i) command += std::string(" ") + argv[i];
  flags.command = record_flags.command = train_flags.command = command;
  plumb::ExciteFlags excite_flags;
  std::string doctor_bus = "udp:239.74.163.2:43113";
  std::string can_robot, dbc_output, meldis_robot, tune_robot, tune_log, new_key;
  bool homed = false;
  CLI::App *launch = nullptr, *sim = nullptr, *calibrate = nullptr, *excite = nullptr,
           *train = nullptr, *doctor = nullptr, *can_plan = nullptr, *can_dbc = nullptr,
           *arm = nullptr, *disarm = nullptr, *estop = nullptr, *make_key = nullptr,
           *tune = nullptr, *record = nullptr, *replay = nullptr, *meldis = nullptr,
           *export_log = nullptr;
  return plumb::Run(
      "plumb", "Keeps a simulator plumb with its robot.", argc, argv,
      [&](CLI::App& app) {
        app.require_subcommand(1);
        // else -1 would be the greatest of them
        const CLI::Range seed(0.0, 18446744073709551615.0);
        launch = app.add_subcommand("launch",
                                    "run the whole loop: train, roll out, calibrate, train ...");
        launch->add_option("robot", flags.robot, "robot folder or TOML file")
            ->capture_default_str();
        launch->add_option("--seed", flags.seed, "of all random numbers and of the hidden robot")
            ->check(seed)
            ->capture_default_str();
        launch->add_option("--iterations", flags.iterations, "of calibration")
            ->check(CLI::Range(1, 1000))
            ->capture_default_str();
        launch
            ->add_option("--evaluation-episodes", flags.evaluation_episodes,
                         "roll-outs of the final policy")
            ->check(CLI::Range(1, 1000))
            ->capture_default_str();
        launch->add_option("--bus", flags.bus,
                           "CAN bus, e.g. socketcan:can0; default: the robot's own");
        auto* real_time = launch->add_flag(
            "--real-time", flags.real_time,
            "a virtual robot by this machine's clock, as a real one; default: in virtual time");
        launch
            ->add_option("--speed", flags.speed,
                         "in real time the clock's scale; in virtual time at most so many times "
                         "real time, 0 = no limit")
            ->check(CLI::Range(0.0, 100.0));
        plumb::AddRealtimeFlag(*launch, flags.priority);
        launch
            ->add_flag("--real", flags.real,
                       "the robot itself is on the bus: no virtual one, ask before arming")
            ->excludes(real_time);
        launch
            ->add_flag("--unsigned", flags.allow_unsigned,
                       "let the driver obey anybody, although LCM leaves this machine")
            ->excludes(app.get_option("--key"));
        launch->add_option("--log", flags.log, "record all messages to this LCM log");
        launch->add_option("--can-log", flags.can_log,
                           "in virtual time: record all frames to this file, as candump -l does");
        launch
            ->add_option("--dashboard", flags.dashboard,
                         "show the run in browsers; where to listen, default: 127.0.0.1:8765")
            ->expected(0, 1)
            ->type_name("ADDRESS:PORT");
        launch->add_option("--summary", flags.summary, "write the outcome to this JSON file");
        launch->add_option("--output", flags.output,
                           "folder for logs and checkpoints; default: a new one in runs/");
        sim = app.add_subcommand(
            "sim", "simulate the robot's task here and now, without any other process");
        sim->add_option("robot", sim_flags.robot, "robot folder or TOML file")->required();
        auto* policy = sim->add_option("--policy", sim_flags.policy,
                                       "a trainer's checkpoint or an ONNX model that Plumbline has "
                                       "written; its mean action is taken");
        sim->add_flag("--random", sim_flags.random, "random actions; default: none")
            ->excludes(policy);
        sim->add_option("--seed", sim_flags.seed, "of all random numbers")
            ->check(seed)
            ->capture_default_str();
        sim->add_option("--episodes", sim_flags.episodes, "how many")
            ->check(CLI::Range(1, 1000000))
            ->capture_default_str();
        auto* posterior =
            sim->add_option("--posterior", sim_flags.posterior,
                            "a posterior.json: its means instead of the prior's, and its residual");
        sim->add_option("--set", sim_flags.set,
                        "parameters other than their prior means, e.g. mass/thigh=4");
        sim->add_flag("--urdf", sim_flags.urdf,
                      "the robot as its URDF and TOML tables have it, without the prior's means")
            ->excludes(posterior);
        sim->add_option("--noise", sim_flags.noise,
                        "SD or SD,SD of what sensors add to every q [rad or m] and v [rad/s or "
                        "m/s] in the files; one number is for both");
        sim->add_option("--csv", sim_flags.csv, "write every step to this file");
        sim->add_option("--png", sim_flags.png, "draw the first episode as a strip of snapshots");
        sim->add_option("--gif", sim_flags.gif, "draw the first episode as a film");
        calibrate = app.add_subcommand(
            "calibrate", "infer from logs which simulators could have produced the robot's motion");
        calibrate->add_option("robot", calibrate_flags.robot, "robot folder or TOML file")
            ->required();
        calibrate->add_option("--log", calibrate_flags.logs, "LCM log; may be given several times")
            ->allow_extra_args(false);
        calibrate
            ->add_option(
                "--csv", calibrate_flags.tables,
                "table of transitions, columns as in README.md; may be given several times")
            ->allow_extra_args(false);
        calibrate->add_option("--method", calibrate_flags.options.method, "of inference")
            ->check(CLI::IsMember(plumb::CalibrationMethods()))
            ->capture_default_str();
        calibrate->footer(plumb::MethodHelp());
        calibrate->add_option("--seed", calibrate_flags.options.seed, "of all random numbers")
            ->check(seed)
            ->capture_default_str();
        calibrate
            ->add_option("--output", calibrate_flags.output, "the posterior, for programs (JSON)")
            ->capture_default_str();
        calibrate->add_option("--report", calibrate_flags.report,
                              "the findings, for people: an HTML page");
        calibrate->add_option("--urdf", calibrate_flags.urdf,
                              "the robot's URDF with the identified parameters");
        calibrate
            ->add_option("--horizons", calibrate_flags.options.horizons,
                         "control steps of the windows, stage by stage")
            ->check(CLI::Range(1, 1000))
            ->delimiter(',')
            ->capture_default_str();
        calibrate
            ->add_option("--budget", calibrate_flags.options.budget,
                         "transitions that sampling methods may simulate")
            ->check(CLI::Range(100.0, 1e12))
            ->capture_default_str();
        calibrate
            ->add_option("--discrepancy", calibrate_flags.options.discrepancy,
                         "of methods that know only simulations")
            ->capture_default_str();
        calibrate
            ->add_option("--threads", calibrate_flags.threads,
                         "0 = one per core; the result does not depend on it")
            ->check(CLI::Range(0, 1024))
            ->capture_default_str();
        calibrate
            ->add_option(
                "--sbc", calibrate_flags.sbc,
                "instead: that many runs of simulation-based calibration on motions like these")
            ->check(CLI::Range(0, 1000000))
            ->capture_default_str();
        calibrate->add_flag("!--no-residual", calibrate_flags.options.residual,
                            "do not learn what the model lacks where it cannot explain the robot");
        calibrate->add_flag("--strict", calibrate_flags.strict,
                            "exit status 3 if the findings should not be trusted");
        excite = app.add_subcommand(
            "excite", "find the efforts that would tell most of the robot's parameters");
        excite->add_option("robot", excite_flags.robot, "robot folder or TOML file")->required();
        excite
            ->add_option("--seed", excite_flags.seed,
                         "of all random numbers, and of where the robot begins")
            ->check(seed)
            ->capture_default_str();
        excite->add_option("--output", excite_flags.output, "write the best efforts to this table")
            ->capture_default_str();
        excite->add_option("--candidates", excite_flags.candidates, "how many are tried")
            ->check(CLI::Range(1, 10000))
            ->capture_default_str();
        excite->add_option("--seconds", excite_flags.seconds, "of each")
            ->check(CLI::Range(0.01, 600.0))
            ->capture_default_str();
        excite->add_option(
            "--posterior", excite_flags.posterior,
            "a posterior.json to start from, without its residual; default: the prior");
        excite->add_option("--png", excite_flags.png, "draw the best one as a strip of snapshots");
        train =
            app.add_subcommand("train", "train a policy on simulators drawn from a distribution");
        train->add_option("robot", train_flags.robot, "robot folder or TOML file")->required();
        train
            ->add_option("--distribution", train_flags.distribution,
                         "a posterior.json, with the residual that is in it, 'prior', or "
                         "'nominal': the prior's means alone")
            ->capture_default_str();
        train
            ->add_option("--steps", train_flags.steps,
                         "to simulate, e.g. 2e6; default: updates x batch of robot.toml")
            ->check(CLI::Range(1.0, 1e15));
        train->add_option("--seed", train_flags.seed, "of all random numbers")
            ->check(seed)
            ->capture_default_str();
        train
            ->add_option("--threads", train_flags.threads,
                         "0 = one per core; the result does not depend on it")
            ->check(CLI::Range(0, 1024))
            ->capture_default_str();
        train->add_option("--output", train_flags.output, "the policy")->capture_default_str();
        train->add_option("--checkpoint", train_flags.checkpoint,
                          "to resume from; default: the output's name and .checkpoint");
        train->add_option("--csv", train_flags.csv,
                          "write a line of numbers for each update to this file");
        train->add_option("--report", train_flags.report,
                          "how it went, for people: an HTML page; the table is then written, too");
        train->add_option("--from", train_flags.from,
                          "begin with this policy; default: from scratch");
        train->add_flag("--paper", train_flags.paper,
                        "as the paper has it: value targets not normalised, Fisher's matrix of the "
                        "whole batch; 20 passes of the critic");
        train
            ->add_option("--worst-share", train_flags.worst_share,
                         "learn from that share of the episodes, those of lowest return; default: "
                         "robot.toml's")
            ->check(CLI::Range(0.01, 1.0));
        train
            ->add_option("--worst-after", train_flags.worst_after,
                         "updates that learn from all episodes first; default: robot.toml's")
            ->check(CLI::Range(0, 1000000000));
        train
            ->add_option("--evaluate-every", train_flags.evaluate_every,
                         "updates, for the table's evaluation_return; 0 = never")
            ->check(CLI::Range(0, 1000000))
            ->capture_default_str();
        train->add_option("--held-out", train_flags.held_out, "simulators to judge the policy by")
            ->check(CLI::Range(1, 1000000))
            ->capture_default_str();
        doctor = app.add_subcommand("doctor", "check that this machine is ready for a run");
        doctor->add_option("--bus", doctor_bus, "CAN bus that is going to be used")
            ->capture_default_str();
        CLI::App* can = app.add_subcommand("can", "the plan of the robot's CAN bus");
        can->require_subcommand(1);
        can_plan = can->add_subcommand(
            "plan", "ids, load and response times; exit status 1 if it cannot work");
        can_plan->add_option("robot", can_robot, "robot folder or TOML file")->required();
        can_dbc = can->add_subcommand("dbc", "all messages as a DBC file, for other tools");
        can_dbc->add_option("robot", can_robot, "robot folder or TOML file")->required();
        can_dbc->add_option("--output", dbc_output, "file; default: print it");
        CLI::App* estimate = app.add_subcommand("estimate", "settings of the estimator");
        estimate->require_subcommand(1);
        tune = estimate->add_subcommand(
            "tune", "infer the noise of sensors and motion from a log, for robot.toml");
        tune->add_option("robot", tune_robot, "robot folder or TOML file")->required();
        tune->add_option("--log", tune_log, "LCM log with JOINT_STATE and IMU")->required();
        arm = app.add_subcommand("arm", "switch the motors on, also after a fault");
        arm->add_flag("--homed", homed,
                      "joints whose drives have restarted are where their encoders say");
        disarm = app.add_subcommand("disarm", "switch the motors off");
        estop = app.add_subcommand("estop", "emergency stop");
        record = app.add_subcommand("record", "record all messages to an LCM log, until Ctrl-C");
        record->add_option("file", record_flags.log, "the log; lcm-logplayer and --log read it")
            ->required();
        record->add_option("--robot", record_flags.robot,
                           "robot folder or TOML file, of which a copy is kept beside the log");
        record->add_option("--note", record_flags.note, "what this is, kept beside the log");
        replay = app.add_subcommand(
            "replay", "say on LCM what a log has, when it has it; keys pause, seek, change speed");
        replay->add_option("log", replay_flags.log, "LCM log")->required();
        replay->add_option("--from", replay_flags.part.from, "seconds from the log's beginning")
            ->check(CLI::Range(0.0, 1e9))
            ->capture_default_str();
        replay->add_option("--to", replay_flags.part.to, "default: to the end")
            ->check(CLI::Range(0.0, 1e9));
        replay
            ->add_option("--speed", replay_flags.speed,
                         "times the log's own; 0 = as fast as all who listen on this machine can")
            ->check(CLI::Range(0.0, 1000.0))
            ->capture_default_str();
        replay->add_flag("--loop", replay_flags.part.again, "again and again");
        export_log = app.add_subcommand(
            "export", "write what a log has for Foxglove, Lichtblick, PlotJuggler, spreadsheets");
        export_log->add_option("log", export_flags.log, "LCM log")->required();
        export_log->add_option("--mcap", export_flags.mcap,
                               "an MCAP file: messages in JSON, and the robot in pictures");
        export_log->add_option("--csv", export_flags.csv, "a folder: a table for each channel");
        export_log->add_option("--robot", export_flags.robot,
                               "robot folder or TOML file; default: the one beside the log");
        meldis = app.add_subcommand(
            "meldis", "say what Drake's meldis draws of the state that is heard, until Ctrl-C");
        meldis->add_option("robot", meldis_robot, "robot folder or TOML file")->required();
        make_key = app.add_subcommand("key", "make a key to sign commands with");
        make_key->add_option("file", new_key, "a new file, which only its owner may read")
            ->required();
        for (CLI::App* sub :
             {launch, sim, calibrate, excite, train, doctor, can, can_plan, can_dbc, estimate, tune,
              arm, disarm, estop, record, replay, export_log, meldis, make_key})
          sub->fallthrough();
        plumb::AddCommandExamples(app);
      },
      [&](plumb::Process& process) {
        if (launch->count("--dashboard") > 0 && flags.dashboard.empty())
          flags.dashboard = "127.0.0.1:8765";
        if (launch->parsed()) return plumb::Launch(process, flags);
        if (sim->parsed()) return plumb::Simulate(process, sim_flags);
        if (calibrate->parsed()) return plumb::CalibrateLogs(process, calibrate_flags, command);
        if (excite->parsed()) return plumb::Excite(process, excite_flags);
        if (train->parsed()) return plumb::Train(process, train_flags);
        if (doctor->parsed())
          return plumb::Doctor(process.lcm_url(), doctor_bus, process.key_file());
        if (can_plan->parsed()) return plumb::PrintBusPlan(can_robot);
        if (can_dbc->parsed()) return plumb::WriteDbc(can_robot, dbc_output);
        if (tune->parsed()) return plumb::TuneEstimator(tune_robot, tune_log);
        if (arm->parsed()) {
          return plumb::RequestDriver(
              process, homed ? plumb::driver_request_t::ARM_HOMED : plumb::driver_request_t::ARM);
        }
        if (disarm->parsed()) return plumb::RequestDriver(process, plumb::driver_request_t::DISARM);
        if (record->parsed()) return plumb::Record(process, record_flags);
        if (replay->parsed()) return plumb::Replay(process, replay_flags);
        if (export_log->parsed()) return plumb::Export(export_flags);
        if (meldis->parsed()) return plumb::ShowInMeldis(process, meldis_robot);
        if (make_key->parsed()) return plumb::MakeKey(new_key);
        return plumb::RequestDriver(process, plumb::driver_request_t::ESTOP);
      });
}
