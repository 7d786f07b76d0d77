#include <cmath>
#include <string>

#include "cli/calibrate.h"
#include "cli/command.h"
#include "cli/excite.h"
#include "cli/export_model.h"
#include "cli/serve_model.h"
#include "cli/sim.h"
#include "cli/train.h"
#include "common/seed_range.h"

namespace plumb {
namespace {

void AddSim(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<SimFlags>();
  CLI::App* sim =
      AddCommand(app, "sim", "simulate the robot's task here and now, without any other process");
  sim->add_option("robot", flags->robot, "robot folder or TOML file")->required();
  auto* policy = sim->add_option("--policy", flags->policy,
                                 "a trainer's checkpoint or an ONNX model that Plumbline has "
                                 "written; its mean action is taken");
  auto* efforts = sim->add_option("--efforts", flags->efforts,
                                  "a table of efforts to play one after the other, as `plumb "
                                  "excite` writes it")
                      ->excludes(policy);
  sim->add_flag("--random", flags->random, "random actions; default: none")
      ->excludes(policy)
      ->excludes(efforts);
  sim->add_option("--seed", flags->seed, "of all random numbers")
      ->check(SeedRange())
      ->capture_default_str();
  sim->add_option("--episodes", flags->episodes, "how many")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  auto* posterior =
      sim->add_option("--posterior", flags->posterior,
                      "a posterior.json: its means instead of the prior's, and its residual");
  sim->add_option("--set", flags->set,
                  "parameters other than their prior means, e.g. mass/thigh=4");
  sim->add_flag("--urdf", flags->urdf,
                "the robot as its URDF and TOML tables have it, without the prior's means")
      ->excludes(posterior);
  auto* csv = sim->add_option("--csv", flags->csv, "write every step to this file");
  sim->add_option("--noise", flags->noise,
                  "SD or SD,SD of what sensors add to every q [rad or m] and v [rad/s or "
                  "m/s] in that file; one number is for both")
      ->needs(csv);
  sim->add_option("--png", flags->png, "draw the first episode as a strip of snapshots");
  sim->add_option("--gif", flags->gif, "draw the first episode as a film");
  SetAction(*sim, action, [flags](Process& process) { return Simulate(process, *flags); });
}

void AddRecordings(CLI::App& calibrate, CalibrateFlags& flags) {
  calibrate.add_option("robot", flags.robot, "robot folder or TOML file")->required();
  calibrate.add_option("--log", flags.logs, "LCM log; may be given several times")
      ->allow_extra_args(false);
  calibrate
      .add_option("--csv", flags.tables,
                  "table of transitions, columns: docs/commands.md; may be given several times")
      ->allow_extra_args(false);
}

void AddMethod(CLI::App& calibrate, CalibrationOptions& options) {
  calibrate.add_option("--method", options.method, "of inference")
      ->check(CLI::IsMember(CalibrationMethods()))
      ->capture_default_str();
  calibrate.footer(MethodHelp());
  calibrate.add_option("--seed", options.seed, "of all random numbers")
      ->check(SeedRange())
      ->capture_default_str();
}

void AddFindings(CLI::App& calibrate, CalibrateFlags& flags) {
  calibrate.add_option("--output", flags.output, "the posterior, for programs (JSON)")
      ->capture_default_str();
  calibrate.add_option("--report", flags.report, "the findings, for people: an HTML page");
  calibrate.add_option("--urdf", flags.urdf, "the robot's URDF with the identified parameters");
}

void AddFit(CLI::App& calibrate, CalibrateFlags& flags) {
  calibrate
      .add_option("--horizons", flags.options.horizons,
                  "control steps of the windows, stage by stage")
      ->check(CLI::Range(1, 1000))
      ->delimiter(',')
      ->capture_default_str();
  calibrate
      .add_option_function<double>(
          "--budget",
          [&flags](double transitions) { flags.options.budget = std::llround(transitions); },
          "transitions that sampling methods may simulate, e.g. 1e6")
      ->check(CLI::Range(100.0, 1e12))
      ->default_str(std::to_string(flags.options.budget));
  calibrate
      .add_option("--discrepancy", flags.options.discrepancy,
                  "of methods that know only simulations")
      ->capture_default_str();
  calibrate
      .add_option("--threads", flags.threads, "0 = one per core; the result does not depend on it")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
}

void AddCalibrate(CLI::App& app, const std::string& line, Action& action) {
  const auto flags = std::make_shared<CalibrateFlags>();
  CLI::App* calibrate = AddCommand(
      app, "calibrate", "infer from logs which simulators could have produced the robot's motion");
  AddRecordings(*calibrate, *flags);
  AddMethod(*calibrate, flags->options);
  AddFindings(*calibrate, *flags);
  AddFit(*calibrate, *flags);
  auto* sbc =
      calibrate
          ->add_option(
              "--sbc", flags->sbc,
              "instead: that many runs of simulation-based calibration on motions like these")
          ->check(CLI::Range(0, 1000000))
          ->capture_default_str();
  calibrate->add_flag("!--no-residual", flags->options.residual,
                      "do not learn what the model lacks where it cannot explain the robot");
  auto* model = calibrate->add_option(
      "--model", flags->model,
      "instead of our simulator: one that an UM-Bridge server has, http://HOST:PORT");
  calibrate
      ->add_option("--model-name", flags->model_name,
                   "of that server's: parameters -> q, v at each transition's end")
      ->needs(model)
      ->capture_default_str();
  calibrate->add_flag("--replay", flags->options.replay,
                      "say how far motion that was held out is from its open-loop replay");
  calibrate->add_flag("--strict", flags->strict,
                      "exit status 3 if the findings should not be trusted");
  // What would have no effect.
  sbc->excludes("--model", "--method", "--output", "--report", "--urdf", "--horizons", "--budget",
                "--discrepancy", "--no-residual", "--replay");
  model->excludes("--report", "--horizons", "--budget", "--discrepancy", "--no-residual",
                  "--replay", "--strict", "--threads");
  const auto calibrates = [flags, line](Process& process) {
    return CalibrateLogs(process, *flags, line);
  };
  SetAction(*calibrate, action, calibrates, [flags]() -> std::string {
    const std::string& asked = flags->options.method;
    const bool other = !flags->model.empty() && asked != "auto" && asked != "laplace";
    return other ? "--model is calibrated by laplace: no other --method" : "";
  });
}

void AddExcite(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<ExciteFlags>();
  CLI::App* excite =
      AddCommand(app, "excite", "find the efforts that would tell most of the robot's parameters");
  excite->add_option("robot", flags->robot, "robot folder or TOML file")->required();
  excite->add_option("--seed", flags->seed, "of all random numbers, and of where the robot begins")
      ->check(SeedRange())
      ->capture_default_str();
  excite->add_option("--output", flags->output, "write the best efforts to this table")
      ->capture_default_str();
  excite->add_option("--candidates", flags->candidates, "how many are tried")
      ->check(CLI::Range(1, 10000))
      ->capture_default_str();
  excite->add_option("--seconds", flags->seconds, "of each")
      ->check(CLI::Range(0.01, 600.0))
      ->capture_default_str();
  excite->add_flag("--one-by-one", flags->one_by_one,
                   "move one joint after the other, the others without effort");
  excite->add_option("--posterior", flags->posterior,
                     "a posterior.json to start from, without its residual; default: the prior");
  excite->add_option("--png", flags->png, "draw the best one as a strip of snapshots");
  SetAction(*excite, action, [flags] { return Excite(*flags); });
}

void AddTrain(CLI::App& app, const std::string& line, Action& action) {
  const auto flags = std::make_shared<TrainFlags>();
  flags->command = line;
  CLI::App* train =
      AddCommand(app, "train", "train a policy on simulators drawn from a distribution");
  train->add_option("robot", flags->robot, "robot folder or TOML file")->required();
  train
      ->add_option("--distribution", flags->distribution,
                   "a posterior.json, with the residual that is in it, 'prior', or "
                   "'nominal': the prior's means alone")
      ->capture_default_str();
  train
      ->add_option("--steps", flags->steps,
                   "to simulate, e.g. 2e6; default: updates x batch of robot.toml")
      ->check(CLI::Range(1.0, 1e15));
  train->add_option("--seed", flags->seed, "of all random numbers")
      ->check(SeedRange())
      ->capture_default_str();
  train
      ->add_option("--threads", flags->threads,
                   "0 = one per core; the result does not depend on it")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  train->add_option("--output", flags->output, "the policy")->capture_default_str();
  train->add_option("--checkpoint", flags->checkpoint,
                    "to resume from; default: the output's name and .checkpoint");
  train->add_option("--csv", flags->csv, "write a line of numbers for each update to this file");
  train->add_option("--report", flags->report,
                    "how it went, for people: an HTML page; the table is then written, too");
  train->add_option("--from", flags->from, "begin with this policy; default: from scratch");
  train->add_flag("--paper", flags->paper,
                  "as the paper has it: value targets not normalised, Fisher's matrix of the "
                  "whole batch; 20 passes of the critic");
  train
      ->add_option("--worst-share", flags->worst_share,
                   "learn from that share of the episodes, those of lowest return; default: "
                   "robot.toml's")
      ->check(CLI::Range(0.01, 1.0));
  train
      ->add_option("--worst-after", flags->worst_after,
                   "updates that learn from all episodes first; default: robot.toml's")
      ->check(CLI::Range(0, 1000000000));
  const auto* every = train
                          ->add_option("--evaluate-every", flags->evaluate_every,
                                       "updates, for the table's evaluation_return; 0 = never")
                          ->check(CLI::Range(0, 1000000))
                          ->capture_default_str();
  train->add_option("--held-out", flags->held_out, "simulators to judge the policy by")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  const auto trains = [flags](Process& process) { return Train(process, *flags); };
  SetAction(*train, action, trains, [flags, every]() -> std::string {
    const bool in_vain = every->count() > 0 && flags->csv.empty() && flags->report.empty();
    return in_vain ? "--evaluate-every needs --csv or --report" : "";
  });
}

void AddExportModel(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<ExportModelFlags>();
  CLI::App* export_model = AddCommand(
      app, "export-model", "write what is known of the robot's parameters for other simulators");
  export_model->add_option("robot", flags->robot, "robot folder or TOML file")->required();
  export_model->add_option("--posterior", flags->posterior,
                           "a posterior.json; default: what robot.toml says, the prior");
  export_model->add_option("--urdf", flags->urdf, "the robot's URDF with the parameters' means");
  export_model->add_option("--mjcf", flags->mjcf, "the same robot as MuJoCo's XML");
  auto* randomisation =
      export_model->add_option("--randomisation", flags->randomisation,
                               "mean, covariance and samples of the parameters (JSON)");
  export_model->add_option("--samples", flags->samples, "of the parameters")
      ->needs(randomisation)
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  export_model->add_option("--seed", flags->seed, "of all random numbers")
      ->needs(randomisation)
      ->check(SeedRange())
      ->capture_default_str();
  SetAction(*export_model, action, [flags] { return ExportModel(*flags); });
}

void AddServeModel(CLI::App& app, Action& action) {
  const auto flags = std::make_shared<ServeModelFlags>();
  CLI::App* serve = AddCommand(
      app, "serve-model",
      "serve what logs say of the robot's parameters to UM-Bridge's clients, until Ctrl-C");
  serve->add_option("robot", flags->robot, "robot folder or TOML file")->required();
  serve->add_option("--log", flags->logs, "LCM log; may be given several times")
      ->allow_extra_args(false);
  serve
      ->add_option(
          "--csv", flags->tables,
          "table of transitions, columns as in docs/commands.md; may be given several times")
      ->allow_extra_args(false);
  serve->add_option("--address", flags->address, "where to listen, ADDRESS:PORT; port 0 = any")
      ->capture_default_str();
  serve
      ->add_option("--host", flags->hosts,
                   "another name by which clients may call this machine; may be repeated")
      ->allow_extra_args(false);
  serve
      ->add_option("--threads", flags->threads,
                   "0 = one per core; the result does not depend on it")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  SetAction(*serve, action, [flags](Process& process) { return ServeModel(process, *flags); });
}

}  // namespace

void AddSimulatorCommands(CLI::App& app, const std::string& line, Action& action) {
  AddSim(app, action);
  AddCalibrate(app, line, action);
  AddExcite(app, action);
  AddTrain(app, line, action);
  AddExportModel(app, action);
  AddServeModel(app, action);
}

}  // namespace plumb
