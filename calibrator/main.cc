// plumb-calibrator: ROBOT_STATE_SMOOTHED, JOINT_COMMAND, CONTROLLER_STATUS ->
// PARAMETER_DISTRIBUTION.

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <filesystem>
#include <iostream>

#include "calibrator/live/calibrator.h"
#include "calibrator/live/checkpoint.h"
#include "calibrator/motion/motion_log.h"
#include "calibrator/motion/recorded_robot.h"
#include "calibrator/results/posterior_file.h"
#include "common/examples.h"
#include "common/name_lock.h"
#include "common/process.h"
#include "common/seed_range.h"
#include "common/thread_count.h"
#include "common/time_units.h"

namespace plumb {
namespace {

struct Flags {
  std::string robot;
  std::string log;
  std::string checkpoint = "calibration";
  std::string method;
  uint64_t seed = 1;
  int threads = 0;
};

/// SimOpt fed with messages: common to the live run and to a log.
class Session {
 public:
  Session(const RobotDescription& robot, const Flags& flags, const Clock& clock, bool anew)
      : robot_(robot),
        clock_(clock),
        folder_(flags.checkpoint),
        start_(clock.Now()),
        lock_(
            "calibration " + NameOfFile(flags.checkpoint),
            flags.checkpoint + ": another calibrator is at work there: give another --checkpoint"),
        simopt_(robot, flags.seed, ThreadCount(flags.threads),
                flags.method.empty() ? robot.calibration.method : flags.method),
        calibrator(robot, simopt_),
        checkpoint_(flags.checkpoint, robot, flags.seed) {
    // A run in virtual time begins anew, and comes to the same: its roll-outs are what they were.
    if (auto state = checkpoint_.Load(); state && !anew) {
      try {
        simopt_.Resume(std::move(*state));
      } catch (const std::invalid_argument& error) {
        throw std::invalid_argument(fmt::format("{}: {}", flags.checkpoint, error.what()));
      }
      spdlog::info("resumed after iteration {}, update {}", simopt_.state().iteration,
                   simopt_.state().search.update);
      report_ = simopt_.Report();
      if (report_) WriteFindings();  // a kill may have come before it
    }
  }

  bool busy() const { return simopt_.running() || calibrator.ready(); }

  /// Does one update if there is something to do. @return true when an iteration has been
  /// completed.
  bool Work() {
    if (!simopt_.running() && calibrator.ready()) {
      start_ = clock_.Now();
      if (calibrator.Begin() == 0) {
        spdlog::warn(
            "iteration {} has no usable transition: it goes by with the earlier ones; dropped so "
            "far: {}",
            simopt_.state().iteration + 1, calibrator.drops().summary());
      }
      checkpoint_.Save(simopt_.state());
    }
    if (!simopt_.running()) return false;
    auto report = simopt_.Update();
    checkpoint_.Save(simopt_.state());
    if (!report) return false;
    const int64_t failed = report->failures.total() - (report_ ? report_->failures.total() : 0);
    if (failed > 0)
      spdlog::warn("{} simulations failed in this iteration: they count as infinitely far", failed);
    for (const std::string& warning : report->warnings)
      spdlog::warn("iteration {}: {}", report->iteration, warning);
    for (const std::string& text : {report->alarm, report->gap})
      if (!text.empty()) spdlog::warn("iteration {}: {}", report->iteration, text);
    report_ = std::move(report);
    seconds_ = Seconds(clock_.Now() - start_) / clock_.scale();
    WriteFindings();
    return true;
  }

  /// Takes account of what has arrived of a roll-out under way: for the status only.
  void Stream() {
    const Rollout arrived = calibrator.TakeArrived();
    if (arrived.transitions.empty()) return;
    // the complete roll-outs, as they were joined
    if (!stream_ || streamed_iteration_ != simopt_.state().iteration) {
      stream_.emplace(std::make_shared<Model>(robot_));
      streamed_iteration_ = simopt_.state().iteration;
      for (const Rollout& rollout : simopt_.state().rollouts) Assimilate(rollout);
    }
    Assimilate(arrived);
  }

  parameter_distribution_t Distribution() const {
    return DistributionMessage(robot_, simopt_.state(), simopt_.seed(),
                               report_ ? &*report_ : nullptr);
  }
  calibration_status_t Status() const {
    return StatusMessage(
        robot_, simopt_.state(), calibrator.drops(), report_ ? &*report_ : nullptr, seconds_,
        stream_ && streamed_iteration_ == simopt_.state().iteration ? &*stream_ : nullptr);
  }

 private:
  void Assimilate(const Rollout& rollout) {
    for (const Transition& transition : rollout.transitions)
      stream_->Add(transition, rollout.episode);
  }

  void WriteFindings() const {
    WritePosterior(folder_ / fmt::format("posterior_{}.json", report_->iteration),
                   IterationFindings(robot_, simopt_, *report_), robot_, {});
  }

  const RobotDescription& robot_;
  const Clock& clock_;
  std::filesystem::path folder_;
  int64_t start_;  // of the calibration, or of its resumption [us]
  const NameLock lock_;
  SimOpt simopt_;

 public:
  Calibrator calibrator;

 private:
  CalibrationCheckpoint checkpoint_;
  std::optional<CalibrationReport> report_;
  std::optional<StreamingLaplace> stream_;
  int streamed_iteration_ = 0;
  double seconds_ = 0;  // that the last one took, real ones
};

int RunLive(Process& process, Session& session, const RobotDescription& robot) {
  Messenger& messenger = process.messenger();
  messenger.Follow(robot.name);
  Publisher<parameter_distribution_t> distribution(messenger, "PARAMETER_DISTRIBUTION");
  Publisher<calibration_status_t> status(messenger, "CALIBRATION_STATUS");
  Subscriber<robot_state_t> states(messenger, "ROBOT_STATE_SMOOTHED",
                                   [&](const robot_state_t& m) { session.calibrator.OnState(m); });
  Subscriber<joint_command_t> commands(messenger, "JOINT_COMMAND", [&](const joint_command_t& m) {
    session.calibrator.OnCommand(m);
  });
  Subscriber<controller_status_t> controller(
      messenger, "CONTROLLER_STATUS",
      [&](const controller_status_t& m) { session.calibrator.OnControllerStatus(m); });
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

int RunLog(Process& process, Session& session, const RobotDescription& robot,
           const std::string& file) {
  for (const std::string& warning : CheckRecordedRobot(file, robot)) spdlog::warn("{}", warning);
  const MotionCounts counts = ReadMotion(file, session.calibrator, [&] {
    while (session.busy() && !process.stopping()) {
      if (session.Work()) PrintIteration(session.Status(), robot);
    }
    return !process.stopping();
  });
  if (process.stopping()) return 130;
  const calibration_status_t found = session.Status();
  spdlog::info("{} events, {} undecodable; dropped transitions: {}", counts.events,
               counts.undecodable, session.calibrator.drops().summary());
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
        app.add_option("--method", flags.method, "of inference; default: as robot.toml says")
            ->check(CLI::IsMember(plumb::LiveMethods()));
        app.add_option("--seed", flags.seed, "of the random numbers")
            ->check(plumb::SeedRange())
            ->capture_default_str();
        app.add_option("--checkpoint", flags.checkpoint,
                       "folder for checkpoints and posterior_<iteration>.json")
            ->capture_default_str();
        app.add_option("--threads", flags.threads,
                       "0 = one per core; the result does not depend on it")
            ->check(CLI::Range(0, 1024))
            ->capture_default_str();
        plumb::AddExamples(app, {"plumb-calibrator robots/pendulum --checkpoint run"});
      },
      [&](plumb::Process& process) {
        const plumb::RobotDescription robot = plumb::LoadRobot(flags.robot);
        plumb::Session session(robot, flags, process.clock(), process.begins_virtual_run());
        return flags.log.empty() ? plumb::RunLive(process, session, robot)
                                 : plumb::RunLog(process, session, robot, flags.log);
      });
}
