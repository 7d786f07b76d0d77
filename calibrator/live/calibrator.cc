#include "calibrator/live/calibrator.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "common/special_numbers.h"
#include "plumb/policy_t.hpp"

namespace plumb {
namespace {

/// Without those of an iteration under way: what is said of the one before stays as it is.
std::span<const Rollout> Completed(const SimOpt::State& state) {
  const bool running = static_cast<int>(state.rollouts_per_iteration.size()) > state.iteration;
  const int newest = running ? state.rollouts_per_iteration.back() : 0;
  return std::span(state.rollouts).first(state.rollouts.size() - static_cast<size_t>(newest));
}

// An iteration's identity is its newest episode's start: a time that live run and replay share.
int64_t Time(const SimOpt::State& state) {
  const std::span<const Rollout> rollouts = Completed(state);
  return rollouts.empty() ? 0 : rollouts.back().episode;
}

}  // namespace

void Calibrator::OnCommand(const joint_command_t& command) {
  joiner_.OnCommand(command);
  if (command.episode >= 0) newest_episode_ = command.episode;
}

Rollout Calibrator::TakeArrived() {
  Rollout rollout;
  rollout.episode = newest_episode_;
  rollout.policy_iteration = simopt_.state().iteration;
  if (rolling_out_) rollout.transitions = joiner_.TakeArrived(newest_episode_);
  return rollout;
}

void Calibrator::OnControllerStatus(const controller_status_t& status) {
  rolling_out_ = status.phase == controller_status_t::RUNNING &&
                 status.purpose == policy_t::CALIBRATE &&
                 status.policy_iteration == simopt_.state().iteration;
  if (status.phase != controller_status_t::COMPLETE || status.purpose != policy_t::CALIBRATE)
    return;
  // The policy of iteration k is rolled out to compute the distribution of iteration k + 1.
  if (status.policy_iteration != simopt_.state().iteration || status.num_episodes == 0) return;
  complete_ = status;
}

bool Calibrator::ready() const {
  if (!complete_ || simopt_.running() || complete_->policy_iteration != simopt_.state().iteration)
    return false;
  for (size_t i = 0; i < complete_->episode.size(); ++i) {
    if (joiner_.Awaits(complete_->episode[i], complete_->last_state_sequence[i])) return false;
  }
  return true;
}

size_t Calibrator::Begin() {
  std::vector<Rollout> rollouts;
  rollouts.reserve(complete_->episode.size());
  for (size_t i = 0; i < complete_->episode.size(); ++i) {
    rollouts.push_back(joiner_.Join(complete_->episode[i], complete_->last_state_sequence[i]));
  }
  complete_.reset();
  const size_t usable = CountTransitions(rollouts);
  simopt_.Begin(std::move(rollouts));
  return usable;
}

ParameterDistribution DistributionOf(const RobotDescription& robot, const SimOpt::State& state) {
  return {state.iteration, robot.parameters, state.distribution,
          state.residual,  state.explained,  Starts(Completed(state))};
}

parameter_distribution_t DistributionMessage(const RobotDescription& robot,
                                             const SimOpt::State& state, uint64_t seed,
                                             const CalibrationReport* report) {
  parameter_distribution_t m = DistributionOf(robot, state).ToMessage();
  m.utime = Time(state);
  m.seed = static_cast<int64_t>(seed);
  if (report) {
    m.kl = report->kl;
    m.ess = report->ess;
    m.temperature = report->temperature;
    m.discrepancy = report->discrepancy;
  }
  return m;
}

Findings IterationFindings(const RobotDescription& robot, const SimOpt& simopt,
                           const CalibrationReport& report) {
  const SimOpt::State& state = simopt.state();
  Findings findings;
  findings.method = simopt.method();
  findings.used = state.used;
  findings.seed = simopt.seed();
  findings.prior = PriorGaussian(robot);
  findings.posterior = state.distribution;
  findings.transitions = static_cast<int64_t>(CountTransitions(state.rollouts));
  findings.discrepancy = report.discrepancy;
  findings.identifiability = report.identifiability;
  findings.cramer_rao = report.identifiability.cramer_rao;
  findings.gap.residual = state.residual;
  findings.starts = Starts(state.rollouts);
  findings.warnings = report.warnings;
  findings.loop = {report.iteration, Time(state),    report.kl,   report.ess, report.temperature,
                   state.explained,  state.informed, state.alarm, state.gap};
  return findings;
}

calibration_status_t StatusMessage(const RobotDescription& robot, const SimOpt::State& state,
                                   const DropCounts& drops, const CalibrationReport* report,
                                   double seconds, const StreamingLaplace* stream) {
  calibration_status_t m{};
  m.utime = Time(state);
  m.iteration = state.iteration;
  m.transitions = static_cast<int32_t>(CountTransitions(Completed(state)));
  m.rollouts = static_cast<int32_t>(Completed(state).size());
  m.dropped_gap = drops.gap;
  m.dropped_late = drops.late;
  m.dropped_not_finite = drops.not_finite;
  m.dropped_restart = drops.restart;
  m.dropped_model_based = drops.model_based;
  m.discrepancy = report ? report->discrepancy : kNaN;
  m.prior_discrepancy = report ? report->prior_discrepancy : kNaN;
  m.kl = report ? report->kl : kNaN;
  m.ess = report ? report->ess : kNaN;
  m.temperature = report ? report->temperature : kNaN;
  if (report) {
    for (const PredictionErrors& errors : report->errors) {
      m.horizon.push_back(errors.horizon);
      m.error_before.push_back(errors.before);
      m.error_after.push_back(errors.after);
      m.error_prior.push_back(errors.prior);
    }
    for (const Combination& c : report->identifiability.combinations) {
      m.combination.push_back(c.name);
      m.combination_power.insert(m.combination_power.end(), c.power.begin(), c.power.end());
      m.combination_mean.push_back(c.mean);
      m.combination_sd.push_back(c.sd);
    }
    m.identifiability = report->identifiability.summary;
  }
  m.num_horizons = static_cast<int32_t>(m.horizon.size());
  m.num_powers = static_cast<int32_t>(m.combination_power.size());
  m.num_combinations = static_cast<int32_t>(m.combination.size());
  const ParameterDistribution distribution = DistributionOf(robot, state);
  const Eigen::VectorXd mean = distribution.Mean(), sd = distribution.Sd();
  m.mean.assign(mean.begin(), mean.end());
  m.sd.assign(sd.begin(), sd.end());
  m.num_parameters = static_cast<int32_t>(m.mean.size());
  m.seconds = seconds;
  if (report) m.alarm = report->alarm, m.gap = report->gap;
  if (stream && stream->determined()) {
    const ParameterDistribution streamed{
        state.iteration, robot.parameters, {{1}, {stream->posterior()}}};
    const Eigen::VectorXd streamed_mean = streamed.Mean(), streamed_sd = streamed.Sd();
    m.streamed_transitions = static_cast<int32_t>(stream->transitions() - stream->left_out());
    m.streamed_mean.assign(streamed_mean.begin(), streamed_mean.end());
    m.streamed_sd.assign(streamed_sd.begin(), streamed_sd.end());
  }
  m.num_streamed = static_cast<int32_t>(m.streamed_mean.size());
  return m;
}

}  // namespace plumb
