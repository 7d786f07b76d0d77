#include "calibrator/live/session.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <stdexcept>
#include <utility>

#include "calibrator/motion/transitions.h"
#include "calibrator/results/posterior_file.h"
#include "common/thread_count.h"
#include "common/time_units.h"
#include "sim/model.h"

namespace plumb {

CalibrationSession::CalibrationSession(const RobotDescription& robot, const Settings& settings,
                                       const Clock& clock)
    : robot_(robot),
      clock_(clock),
      folder_(settings.folder),
      start_(clock.Now()),
      lock_("calibration " + NameOfFile(settings.folder),
            settings.folder + ": another calibrator is at work there: give another --checkpoint"),
      simopt_(robot, settings.seed, ThreadCount(settings.threads),
              settings.method.empty() ? robot.calibration.method : settings.method),
      calibrator_(robot, simopt_),
      checkpoint_(settings.folder, robot, settings.seed) {
  if (settings.anew) return;
  if (auto state = checkpoint_.Load()) Resume(std::move(*state));
}

void CalibrationSession::Resume(SimOpt::State state) {
  try {
    simopt_.Resume(std::move(state));
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(fmt::format("{}: {}", folder_.string(), error.what()));
  }
  spdlog::info("resumed after iteration {}, update {}", simopt_.state().iteration,
               simopt_.state().search.update);
  report_ = simopt_.Report();
  if (report_) WriteFindings();  // a kill may have come before it
}

void CalibrationSession::BeginIteration() {
  start_ = clock_.Now();
  if (calibrator_.Begin() == 0) {
    spdlog::warn(
        "iteration {} has no usable transition: it goes by with the earlier ones; dropped so "
        "far: {}",
        simopt_.state().iteration + 1, calibrator_.drops().summary());
  }
  checkpoint_.Save(simopt_.state());
}

bool CalibrationSession::Work() {
  if (!simopt_.running() && calibrator_.ready()) BeginIteration();
  if (!simopt_.running()) return false;
  auto report = simopt_.Update();
  checkpoint_.Save(simopt_.state());
  if (!report) return false;
  Warn(*report);
  report_ = std::move(report);
  seconds_ = Seconds(clock_.Now() - start_) / clock_.scale();
  WriteFindings();
  return true;
}

// Of what is new in a report: simulations that failed are counted since the start of the process.
void CalibrationSession::Warn(const CalibrationReport& report) const {
  const int64_t failed = report.failures.total() - (report_ ? report_->failures.total() : 0);
  if (failed > 0)
    spdlog::warn("{} simulations failed in this iteration: they count as infinitely far", failed);
  for (const std::string& warning : report.warnings)
    spdlog::warn("iteration {}: {}", report.iteration, warning);
  for (const std::string& text : {report.alarm, report.gap})
    if (!text.empty()) spdlog::warn("iteration {}: {}", report.iteration, text);
}

void CalibrationSession::Stream() {
  const Rollout arrived = calibrator_.TakeArrived();
  if (arrived.transitions.empty()) return;
  // the complete roll-outs, as they were joined
  if (!stream_ || streamed_iteration_ != simopt_.state().iteration) {
    stream_.emplace(std::make_shared<Model>(robot_));
    streamed_iteration_ = simopt_.state().iteration;
    for (const Rollout& rollout : simopt_.state().rollouts) Assimilate(rollout);
  }
  Assimilate(arrived);
}

void CalibrationSession::Assimilate(const Rollout& rollout) {
  for (const Transition& transition : rollout.transitions)
    stream_->Add(transition, rollout.episode);
}

parameter_distribution_t CalibrationSession::Distribution() const {
  return DistributionMessage(robot_, simopt_.state(), simopt_.seed(),
                             report_ ? &*report_ : nullptr);
}

calibration_status_t CalibrationSession::Status() const {
  return StatusMessage(
      robot_, simopt_.state(), calibrator_.drops(), report_ ? &*report_ : nullptr, seconds_,
      stream_ && streamed_iteration_ == simopt_.state().iteration ? &*stream_ : nullptr);
}

void CalibrationSession::WriteFindings() const {
  WritePosterior(folder_ / fmt::format("posterior_{}.json", report_->iteration),
                 IterationFindings(robot_, simopt_, *report_), robot_, {});
}

}  // namespace plumb
