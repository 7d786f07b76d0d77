#include "cli/train.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <span>
#include <sstream>
#include <stdexcept>

#include "cli/outputs.h"
#include "cli/training_progress.h"
#include "cli/training_report.h"
#include "common/atomic_file.h"
#include "common/batch_runner.h"
#include "common/config.h"
#include "common/hash.h"
#include "common/name_lock.h"
#include "common/ranks.h"
#include "common/thread_count.h"
#include "robot/residual_json.h"
#include "sim/simulators.h"
#include "trainer/checkpoint.h"
#include "trainer/onnx_policy.h"
#include "trainer/policy_file.h"
#include "trainer/robot_simulation.h"
#include "trainer/session.h"
#include "trainer/trainer.h"

namespace plumb {
namespace {

constexpr double kCheckpointPeriod = 5;  // [s]
constexpr int kEvaluationEpisodes = 20;  // of those along the way
RobotDescription ReadRobot(const TrainFlags& flags) {
  RobotDescription robot = LoadRobot(flags.robot);
  if (flags.paper) robot.training = PaperSettings(robot.training);
  if (flags.worst_share > 0) robot.training.worst_share = flags.worst_share;
  if (flags.worst_after >= 0) robot.training.worst_after = flags.worst_after;
  return robot;
}

ParameterDistribution ReadDistribution(const std::string& name, const RobotDescription& robot) {
  if (name == "prior") return ParameterDistribution::Prior(robot);
  if (name == "nominal") return ParameterDistribution::Nominal(robot);
  return ReadSimulators(name, robot);
}

/// A fingerprint of all that the result depends on, but for the number of steps: a longer run may
/// go on from a shorter one.
uint64_t TrainingIdentity(const TrainFlags& flags, const RobotDescription& robot,
                          const ParameterDistribution& distribution,
                          const std::optional<GaussianPolicy>& start) {
  const TrainingSettings& s = robot.training;
  std::ostringstream text;
  text.precision(17);
  // The robot's file and --paper tell all of its settings but those that other flags give.
  text << VersionLine("plumb") << ' ' << robot.fingerprint << ' ' << flags.paper << ' '
       << s.worst_share << ' ' << s.worst_after << ' ' << flags.seed << ' ';
  for (size_t i = 0; i < distribution.mixture.components.size(); ++i) {
    const Gaussian& component = distribution.mixture.components[i];
    text << distribution.mixture.weights[i] << component.mean << component.covariance;
  }
  if (distribution.residual) text << ResidualJson(*distribution.residual);
  for (const Eigen::VectorXd& begin : distribution.starts) text << begin;
  if (start) text << start->parameters << start->observation_mean << start->observation_scale;
  return Hash(text.str());
}

class Training {
 public:
  Training(TrainFlags flags, Process& process)
      : flags_(std::move(flags)),
        process_(process),
        robot_(ReadRobot(flags_)),
        distribution_(ReadDistribution(flags_.distribution, robot_)),
        trainer_(robot_.training, SimulateRobot(robot_), robot_.effort_limits(), flags_.seed,
                 ThreadCount(flags_.threads, ranks_.OnThisMachine().size()), ranks_) {
    if (!speaks()) spdlog::set_level(spdlog::level::err);
    try {
      RequireSendable(robot_);
    } catch (const std::invalid_argument& error) {
      spdlog::warn("{}", error.what());  // a file has room for it all the same
    }
    if (flags_.checkpoint.empty()) flags_.checkpoint = flags_.output + ".checkpoint";
    if (flags_.csv.empty() && !flags_.report.empty()) {
      flags_.csv = flags_.report + ".csv";  // which nobody has named
      RequireSameKind(flags_.csv, "update,steps,mean_return,", "a table of a training");
    }
    steps_ = flags_.steps > 0 ? static_cast<int64_t>(flags_.steps)
                              : int64_t{robot_.training.first_updates()} * robot_.training.batch;
    if (speaks()) {
      std::vector<std::string> inputs = FilesOf(robot_);
      inputs.insert(inputs.end(), {flags_.distribution, flags_.from});
      RequireOutputs({flags_.output, flags_.checkpoint, flags_.csv, flags_.report}, inputs);
      lock_.emplace("checkpoint " + NameOfFile(flags_.checkpoint),
                    flags_.checkpoint +
                        ": another process is at work on it: give another "
                        "--output or --checkpoint");
    }
    std::optional<GaussianPolicy> start;
    if (!flags_.from.empty()) {
      start = LoadPolicy(flags_.from, robot_, *MakeTask(robot_));
      trainer_.Start(*start);
    }
    identity_ = TrainingIdentity(flags_, robot_, distribution_, start);
    Resume();
  }

  int Run() {
    const ParameterSampler sample = [this](Random& random) { return distribution_.Draw(random); };
    if (speaks() && distribution_.residual)
      std::cout << fmt::format("{:.0f} % of the episodes are simulated with the residual of {}\n",
                               100 * (1 - ParameterDistribution::kPlainShare), flags_.distribution)
                << std::flush;
    ProgressTable table(speaks() ? flags_.csv : "", trainer_.updates());
    {
      TrainingProgress line(speaks());
      const int64_t before = trainer_.steps();
      double saved = 0;
      while (trainer_.steps() < steps_) {
        if (Stopping()) {
          Save(trainer_.state(), false);
          if (speaks())
            std::cerr << fmt::format("\ninterrupted; the same command goes on from {}\n",
                                     flags_.checkpoint);
          return 130;
        }
        const UpdateReport report =
            flags_.paper ? trainer_.Update(sample) : trainer_.UpdateJudged(sample);
        training_return_ = report.mean_return;
        const bool judged =
            flags_.evaluate_every > 0 && trainer_.updates() % flags_.evaluate_every == 0;
        const double evaluation =
            judged ? trainer_.Evaluate(sample, kEvaluationEpisodes).mean : NAN;
        table.Add(trainer_, report, evaluation, clock_.seconds());
        line.Show(trainer_, report, steps_, before);
        for (const std::string& warning : UpdateWarnings(trainer_.updates(), report))
          spdlog::warn("{}", warning);
        if (clock_.seconds() - saved > kCheckpointPeriod) {
          Save(trainer_.state(), false);
          saved = clock_.seconds();
        }
      }
      if (trainer_.steps() > before) Save(trainer_.state(), false);  // would be lost below
    }
    process_.EndAtOnce();  // what follows does not look whether it is to stop
    // A longer run goes on from here, as if it had never ended.
    Conclude(sample, trainer_.state());
    return 0;
  }

 private:
  bool speaks() const { return ranks_.rank() == 0; }

  // All ranks stop after the same update, or the others would wait for ever.
  bool Stopping() {
    std::byte stopping{process_.stopping()};
    ranks_.Broadcast({&stopping, 1});
    return stopping != std::byte{0};
  }

  // Rank 0's file, for all.
  std::optional<Checkpoint> SharedCheckpoint() const {
    std::optional<Checkpoint> checkpoint;
    std::string bytes;
    if (speaks()) {
      checkpoint = LoadCheckpoint(flags_.checkpoint);
      if (checkpoint) bytes = EncodeCheckpoint(*checkpoint);
    }
    size_t size = bytes.size();
    ranks_.Broadcast(std::as_writable_bytes(std::span(&size, 1)));
    if (size == 0) return {};
    bytes.resize(size);
    ranks_.Broadcast(std::as_writable_bytes(std::span(bytes)));
    return DecodeCheckpoint(bytes);
  }

  void Resume() {
    const std::optional<Checkpoint> checkpoint = SharedCheckpoint();
    if (!checkpoint) return;
    if (checkpoint->identity != identity_) {
      // What has ended is in its output; what has not would be lost.
      if (!checkpoint->complete) {
        throw CheckpointError(fmt::format(
            "{} is of another run (robot, settings, distribution, start, seed or version), which "
            "has not ended: delete it, or give another --checkpoint",
            flags_.checkpoint));
      }
      if (speaks())
        std::cout << fmt::format("{} is of another run, which has ended: begins anew\n",
                                 flags_.checkpoint)
                  << std::flush;
      return;
    }
    trainer_.Restore(TrainerStateOf(*checkpoint));
    training_return_ = checkpoint->training_return;
    if (speaks())
      std::cout << fmt::format("goes on from {}: update {}, {} steps\n", flags_.checkpoint,
                               trainer_.updates(), trainer_.steps())
                << std::flush;
  }

  void Save(const TrainerState& state, bool complete) {
    if (!speaks()) return;
    Checkpoint checkpoint;
    SetTrainerState(state, checkpoint);
    checkpoint.seed = flags_.seed, checkpoint.identity = identity_;
    checkpoint.complete = complete, checkpoint.training_return = training_return_;
    checkpoint.distribution = distribution_.ToMessage();
    SaveCheckpoint(flags_.checkpoint, checkpoint);
  }

  void Conclude(const ParameterSampler& sample, const TrainerState& last) {
    const int64_t from = flags_.paper ? trainer_.updates() : trainer_.ReturnToBest(sample);
    const Evaluation own = trainer_.EvaluateHeldOut(sample, flags_.held_out);
    const ParameterDistribution prior = ParameterDistribution::Prior(robot_);
    const Evaluation on_prior = trainer_.EvaluateHeldOut(
        [&](Random& random) { return prior.Sample(random); }, flags_.held_out);
    if (!speaks()) return;
    WritePolicy(own);
    Save(last, true);
    std::cout << fmt::format(
        "{} steps, {} updates, {:.1f} s; policy of update {}\n"
        "return without exploration, {} simulators held out:\n",
        trainer_.steps(), trainer_.updates(), clock_.seconds(), from, flags_.held_out);
    std::cout << fmt::format("  {:24} {}\n", flags_.distribution, Summary(own));
    if (flags_.distribution != "prior")
      std::cout << fmt::format("  {:24} {}\n", "prior", Summary(on_prior));
    if (!flags_.report.empty()) WriteReport(from, own, on_prior);
    std::cout << "wrote " << flags_.output
              << (flags_.report.empty() ? "" : ", " + flags_.report + ", " + flags_.csv)
              << std::endl;
  }

  void WriteReport(int64_t from, const Evaluation& own, const Evaluation& on_prior) const {
    const TrainingOutcome outcome{.command = flags_.command,
                                  .distribution = flags_.distribution,
                                  .from = from,
                                  .updates = trainer_.updates(),
                                  .steps = trainer_.steps(),
                                  .seed = flags_.seed,
                                  .seconds = clock_.seconds(),
                                  .chosen = !flags_.paper,
                                  .own = own,
                                  .on_prior = on_prior};
    WriteAtomically(flags_.report,
                    TrainingReport(robot_, distribution_, outcome, ReadTrainingRows(flags_.csv)));
  }

  void WritePolicy(const Evaluation& evaluation) const {
    PolicyRecord record = MakePolicyRecord(robot_, *MakeTask(robot_));
    record.posterior = flags_.distribution;
    // a file's name says little: also what is in it
    if (flags_.distribution != "prior" && flags_.distribution != "nominal") {
      record.posterior += fmt::format(" {:016x}", Hash(ReadFile(flags_.distribution)));
    }
    record.seed = flags_.seed, record.steps = trainer_.steps(),
    record.training_return = training_return_;
    record.evaluation["simulators"] = evaluation.episodes;
    record.evaluation["failed"] = evaluation.failed;
    if (std::isfinite(evaluation.mean)) {
      record.evaluation["mean"] = evaluation.mean;
      record.evaluation["tenth_percentile"] = evaluation.tenth;
      record.evaluation["worst"] = evaluation.worst;
    }
    WriteOnnxPolicy(flags_.output, {trainer_.policy(), record});
  }

  TrainFlags flags_;
  Process& process_;
  Stopwatch clock_;
  Ranks ranks_;
  RobotDescription robot_;
  ParameterDistribution distribution_;
  Trainer trainer_;
  std::optional<NameLock> lock_;
  double training_return_ = 0;
  int64_t steps_ = 0;
  uint64_t identity_ = 0;
};

}  // namespace

int Train(Process& process, TrainFlags flags) { return Training(std::move(flags), process).Run(); }

}  // namespace plumb
