#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>

#include <optional>
#include <string>
#include <utility>

#include "common/atomic_file.h"
#include "common/examples.h"
#include "common/hash.h"
#include "common/name_lock.h"
#include "common/not_empty.h"
#include "common/process.h"
#include "common/seed_range.h"
#include "common/time_units.h"
#include "plumb/controller_status_t.hpp"
#include "plumb/parameter_distribution_t.hpp"
#include "trainer/kernels/network.h"
#include "trainer/past_trainings.h"
#include "trainer/robot_simulation.h"
#include "trainer/session.h"

namespace plumb {
namespace {

constexpr int64_t kRepeat = 1'000'000;  // [us]
constexpr int kUpdatesPerCheckpoint = 10;

struct Options {
  std::string robot;
  int iterations = 10;
  uint64_t seed = 1;
  std::string checkpoint;
  std::string policy;  // a file; empty = train one
  int threads = 0;
  int evaluation_episodes = 10;
};

/// All that training depends on, but for what a session's checkpoint tells.
uint64_t FingerprintOf(const RobotDescription& robot) {
  return Hash(VersionLine("plumb-trainer"), robot.fingerprint);
}

/// plumb-trainer: turns each PARAMETER_DISTRIBUTION into a POLICY, and chooses among them by what
/// CONTROLLER_STATUS says of their trials.
class TrainerProcess {
 public:
  TrainerProcess(Process& process, const Options& options)
      : process_(process),
        options_(options),
        robot_(LoadRobot(options.robot)),
        session_(robot_, SimulateRobot(robot_), options.iterations, options.seed, options.threads),
        policy_(process.messenger(), "POLICY"),
        status_(process.messenger(), "TRAINING_STATUS"),
        distribution_(process.messenger(), "PARAMETER_DISTRIBUTION",
                      [this](const parameter_distribution_t& message) { OnDistribution(message); }),
        controller_(process.messenger(), "CONTROLLER_STATUS",
                    [this](const controller_status_t& message) { OnController(message); }),
        repeat_(kRepeat, process.clock().Now()) {
    process.messenger().Follow(robot_.name);
    if (!options.checkpoint.empty())
      checkpoint_file_ = options.checkpoint + "/" + kTrainerCheckpoint;
  }

  int Run() {
    Resume();
    spdlog::info("{}: iterations 0 to {}, kernels for {}", robot_.name, options_.iterations,
                 kernels::InstructionSet());
    while (process_.Wait(session_.training() ? 0 : repeat_.Remaining(process_.clock().Now()))) {
      distribution_.Rethrow(), controller_.Rethrow();
      if (session_.training()) Train();
      if (repeat_.Due(process_.clock().Now())) {
        repeat_.Advance(process_.clock().Now());
        Publish();
      }
    }
    if (session_.training()) Save();
    return 0;
  }

 private:
  void Resume() {
    start_ = process_.clock().Now();
    if (checkpoint_file_.empty()) return;
    lock_.emplace(
        "training " + NameOfFile(options_.checkpoint),
        options_.checkpoint + ": another trainer is at work there: give another --checkpoint");
    RemoveLeftovers(options_.checkpoint, ".checkpoint");
    if (process_.participant()) past_.emplace(options_.checkpoint, FingerprintOf(robot_));
    if (process_.begins_virtual_run()) return;
    const std::optional<Checkpoint> checkpoint = LoadCheckpoint(checkpoint_file_);
    if (!checkpoint) return;
    session_.Restore(*checkpoint);
    spdlog::info("resumed iteration {} after update {} of {}", session_.iteration(),
                 session_.update(), session_.updates());
    Publish();
  }

  void OnDistribution(const parameter_distribution_t& message) {
    // Repeats of one that has been dealt with are the normal case.
    const bool newer = session_.training() && message.iteration == session_.iteration();
    if (message.iteration != session_.awaited() && !newer) return;
    if (!newer && session_.awaits_trial()) {
      // It is repeated, and so is CONTROLLER_STATUS.
      if (std::exchange(missed_, session_.iteration()) != session_.iteration())
        spdlog::info("iteration {} waits for the trial of policy {}", message.iteration,
                     session_.iteration());
      return;
    }
    try {
      const ParameterDistribution distribution =
          ParameterDistribution::FromMessage(message, robot_);
      if (newer) {
        if (!session_.Replace(distribution)) return;
        if (past_) past_->Forget();
        spdlog::info("iteration {}: a newer distribution from update {} on", session_.iteration(),
                     session_.update() + 1);
        return;
      }
      if (session_.Begin(distribution) && past_) past_->Begin(session_);
      repeated_.reset();
    } catch (const std::invalid_argument& error) {
      spdlog::warn("ignored: {}", error.what());
      return;
    }
    start_ = process_.clock().Now();
    seconds_ = 0;
    if (session_.decision().challenger >= 0)
      spdlog::info("iteration {}: {}", session_.iteration(), Summary(session_.decision()));
    spdlog::info("iteration {}: {} updates", session_.iteration(), session_.updates());
    PublishStatus();  // the decision, which the next one may follow soon
  }

  // Repeated ten times a second.
  void OnController(const controller_status_t& message) {
    if (session_.AddTrial(message)) Save();
  }

  void Train() {
    repeated_ = past_ ? past_->Repeat(session_) : std::nullopt;
    if (!repeated_) Update();
    if (session_.complete()) {
      spdlog::info(
          "iteration {} complete: return without exploration, {} simulators held out: {}; {:.1f} s",
          session_.iteration(), session_.evaluation().episodes, Summary(session_.evaluation()),
          seconds_);
      if (past_) past_->Keep(session_);
      Save();
      process_.TakeVirtualTime(robot_.training.duration);
      Publish();
    } else {
      if (session_.update() % kUpdatesPerCheckpoint == 0) Save();
      PublishStatus();
    }
  }

  void Update() {
    const UpdateReport report = session_.Advance();
    seconds_ = Elapsed();
    spdlog::debug("update {}: return {:.1f}, KL {:.4f}, explained variance {:.3f}",
                  session_.update(), report.mean_return, report.step.kl, report.explained_variance);
    for (const std::string& warning : UpdateWarnings(session_.update(), report))
      spdlog::warn("{}", warning);
    if (past_) past_->Add(session_.Status());
  }

  void Save() {
    if (checkpoint_file_.empty()) return;
    if (past_ && session_.training()) {
      if (!past_->repeating()) past_->Keep(session_);
      return;
    }
    SaveCheckpoint(checkpoint_file_,
                   past_ ? past_->MakeCheckpoint(session_) : session_.MakeCheckpoint());
  }

  void Publish() {
    PublishStatus();
    if (!session_.complete()) return;
    policy_t message = session_.Policy(options_.evaluation_episodes);
    message.utime = process_.clock().Utime();
    policy_.Publish(message);
  }

  void PublishStatus() {
    training_status_t message =
        past_ && past_->repeating() && repeated_ ? *repeated_ : session_.Status();
    message.utime = process_.clock().Utime();
    message.seconds = seconds_;
    status_.Publish(message);
  }

  /// Wall time of this iteration in this process.
  double Elapsed() const {
    return Seconds(process_.clock().Now() - start_) / process_.clock().scale();
  }

  Process& process_;
  Options options_;
  RobotDescription robot_;
  TrainingSession session_;
  Publisher<policy_t> policy_;
  Publisher<training_status_t> status_;
  Subscriber<parameter_distribution_t> distribution_;
  Subscriber<controller_status_t> controller_;
  Periodic repeat_;
  std::string checkpoint_file_;                // empty = none
  std::optional<NameLock> lock_;               // of the checkpoints
  std::optional<PastTrainings> past_;          // in virtual time, if there are checkpoints
  std::optional<training_status_t> repeated_;  // of the last update, if it was made before
  int64_t start_ = 0;                          // of the iteration, monotonic
  double seconds_ = 0;                         // spent on the iteration
  int missed_ = -1;  // policy whose trial was not there when it was needed
};

/// Tells once what a controller makes of a policy that is sent to it again and again.
class Played {
 public:
  void OnSent() { ++sent_; }

  void OnController(const controller_status_t& status) {
    if (status.policy_iteration != 0 || status.purpose != policy_t::EVALUATE) return;
    const bool complete = status.phase == controller_status_t::COMPLETE;
    if (complete && !told_) {
      if (begun_)
        spdlog::info("{} episodes are done", status.num_episodes);
      else if (sent_ < 2)
        return;  // of a policy before
      else
        spdlog::warn(
            "this policy has been played already: start the controller again, or give another "
            "--evaluation-episodes");
    }
    told_ = complete;
    begun_ = begun_ || (sent_ > 0 && !complete);
  }

 private:
  int sent_ = 0;
  bool begun_ = false, told_ = false;
};

/// Sends a policy of a file as the last one of a run would be sent, and trains nothing.
int SendPolicy(Process& process, const Options& options) {
  const RobotDescription robot = LoadRobot(options.robot);
  policy_t message = LoadSendablePolicy(options.policy, robot).ToMessage();
  message.iteration = message.trained_in = 0;
  message.purpose = policy_t::EVALUATE;
  message.episodes = options.evaluation_episodes;
  message.trial_steps = 0;
  process.messenger().Follow(robot.name);
  Publisher<policy_t> publisher(process.messenger(), "POLICY");
  Played played;
  Subscriber<controller_status_t> controller(
      process.messenger(), "CONTROLLER_STATUS",
      [&](const controller_status_t& status) { played.OnController(status); });
  spdlog::info("{}: sends {}, trains nothing", robot.name, options.policy);
  Periodic repeat(kRepeat, process.clock().Now());
  while (process.Wait(repeat.Remaining(process.clock().Now()))) {
    if (!repeat.Due(process.clock().Now())) continue;
    repeat.Advance(process.clock().Now());
    message.utime = process.clock().Utime();
    publisher.Publish(message);
    played.OnSent();
  }
  return 0;
}

}  // namespace
}  // namespace plumb

int main(int argc, char** argv) {
  plumb::Options options;
  return plumb::Run(
      "plumb-trainer",
      "Trains a policy on simulators drawn from each PARAMETER_DISTRIBUTION and sends it as POLICY",
      argc, argv,
      [&](CLI::App& app) {
        app.add_option("robot", options.robot, "robot folder or TOML file")->required();
        auto* iterations = app.add_option("--iterations", options.iterations,
                                          "calibrations; the policy after the last is evaluated")
                               ->check(CLI::Range(0, 10000))
                               ->capture_default_str();
        app.add_option("--seed", options.seed, "of all random numbers")
            ->check(plumb::SeedRange())
            ->capture_default_str();
        auto* checkpoint = app.add_option("--checkpoint", options.checkpoint,
                                          "folder to checkpoint in and to resume from");
        app.add_option("--policy", options.policy,
                       "train nothing, send this policy: an ONNX model or a trainer's checkpoint")
            ->check(plumb::NotEmpty())
            ->excludes(iterations, checkpoint);
        app.add_option("--threads", options.threads, "0 = all processors")
            ->check(CLI::Range(0, 1024))
            ->capture_default_str();
        app.add_option("--evaluation-episodes", options.evaluation_episodes,
                       "roll-outs of the last policy")
            ->check(CLI::Range(1, 10000))
            ->capture_default_str();
        plumb::AddExamples(app, {"plumb-trainer robots/pendulum --seed 3",
                                 "plumb-trainer robots/pendulum --policy policy.onnx"});
      },
      [&](plumb::Process& process) {
        return options.policy.empty() ? plumb::TrainerProcess(process, options).Run()
                                      : plumb::SendPolicy(process, options);
      });
}
