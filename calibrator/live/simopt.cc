#include "calibrator/live/simopt.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "calibrator/fit/likelihood_methods.h"
#include "calibrator/fit/physical_columns.h"
#include "calibrator/motion/differences.h"
#include "robot/parameter_distribution.h"

namespace plumb {
namespace {

// Where the paper's objectives end in costs mapped to [0, 1] (table of Cui & Hensel).
constexpr double kScaledMinTemperature = 0.01;

// [control steps] beyond which one-step models of robots do not hold
constexpr int kLongestWindow = 50;

std::optional<Objective> ParseObjective(const std::string& method) {
  if (method == "reps") return Objective::kPosterior;
  if (method == "simopt") return Objective::kTrajectory;
  return {};
}

}  // namespace

std::vector<Eigen::VectorXd> Starts(std::span<const Rollout> rollouts) {
  std::vector<const Transition*> all, first;
  for (const Rollout& rollout : rollouts) {
    for (const Transition& t : rollout.transitions) {
      all.push_back(&t);
      if (t.step == 0) first.push_back(&t);
    }
  }
  std::vector<Eigen::VectorXd> starts;
  const auto add = [&](const Transition& t) {
    Eigen::VectorXd start(t.q.size() + t.v.size());
    start << t.q, t.v;
    starts.push_back(start.cast<float>().cast<double>());  // as messages have it
  };
  if (first.empty()) return starts;
  for (size_t i = 0; i < kStarts / 2; ++i) {
    add(*first[first.size() - 1 - i % first.size()]);
    add(*all[i * all.size() / (kStarts / 2)]);
  }
  return starts;
}

SimOpt::SimOpt(const RobotDescription& robot, uint64_t seed, int threads, Objective objective)
    : SimOpt(robot, seed, threads, "reps") {
  objective_ = objective;
}

SimOpt::SimOpt(const RobotDescription& robot, uint64_t seed, int threads, const std::string& method)
    : robot_(robot),
      seed_(seed),
      threads_(threads),
      method_(method),
      objective_(ParseObjective(method)),
      model_(std::make_shared<Model>(robot)),
      prior_(PriorGaussian(robot)),
      discrepancy_(robot, threads) {
  RequireMethod(method);
  state_.method = method_;
  state_.distribution = state_.before = {{1}, {prior_}};
}

SimOpt::~SimOpt() = default;

void SimOpt::Resume(State state) {
  if (state.method != method_) {
    throw std::invalid_argument(fmt::format(
        "the checkpoint was made by method {}, not {}: choose another folder, or delete "
        "it",
        state.method, method_));
  }
  for (const GaussianMixture* mixture : {&state.distribution, &state.before}) {
    for (const Gaussian& component : mixture->components) {
      if (component.mean.size() == prior_.mean.size() &&
          component.covariance.rows() == prior_.mean.size())
        continue;
      throw std::invalid_argument("the checkpoint has another number of parameters than the robot");
    }
  }
  const RepsState& search = state.search;
  if (search.points.cols() != search.densities.size() ||
      (search.points.size() > 0 && search.points.rows() != prior_.mean.size()))
    throw std::invalid_argument("the checkpoint's search is of another robot");
  state_ = std::move(state);
}

bool SimOpt::running() const {
  return static_cast<int>(state_.rollouts_per_iteration.size()) > state_.iteration;
}

void SimOpt::Begin(std::vector<Rollout> rollouts) {
  if (running()) throw std::invalid_argument("a calibration is running");
  state_.rollouts_per_iteration.push_back(static_cast<int>(rollouts.size()));
  Forget(CountTransitions(rollouts));
  for (Rollout& rollout : rollouts) state_.rollouts.push_back(std::move(rollout));
  state_.before = state_.distribution;
  state_.kl = 0;
  state_.search = {.distribution = Moments(state_.distribution),
                   .temperature = state_.temperature,
                   .ess = state_.ess};
}

// The oldest roll-outs, for so many new transitions.
void SimOpt::Forget(size_t fresh) {
  size_t kept = fresh + CountTransitions(state_.rollouts);
  auto oldest = state_.rollouts.begin();
  for (; oldest != state_.rollouts.end() && kept > kMostTransitions; ++oldest)
    kept -= oldest->transitions.size();
  state_.forgotten += static_cast<int>(oldest - state_.rollouts.begin());
  state_.rollouts.erase(state_.rollouts.begin(), oldest);
}

std::span<const Rollout> SimOpt::Newest() const {
  const auto count = static_cast<size_t>(state_.rollouts_per_iteration.back());
  return std::span(state_.rollouts).last(count);
}

std::optional<CalibrationReport> SimOpt::Update() {
  state_.warnings.clear();
  objective_ ? Search() : Infer();
  if (state_.search.update < (objective_ ? robot_.calibration.updates : 1)) return {};
  ++state_.iteration;
  return Report();
}

void SimOpt::Search() {
  RepsSearch search(prior_, SearchOptions(), state_.search);
  const bool learned = search.Update(Evaluate(search.Samples()));
  state_.search = search.state();
  if (!learned) return;
  state_.distribution = {{1}, {state_.search.distribution}};
  state_.kl = state_.search.kl;
  state_.ess = state_.search.ess;
  state_.temperature = state_.search.temperature;
  state_.used = method_;
}

RepsOptions SimOpt::SearchOptions() const {
  const bool posterior = objective_ == Objective::kPosterior;
  RepsOptions options;
  options.returns = posterior ? RepsReturns::kLogLikelihood : RepsReturns::kUnitRange;
  options.samples = robot_.calibration.samples;
  options.kl = robot_.calibration.kl;
  options.min_temperature = posterior ? robot_.calibration.min_temperature : kScaledMinTemperature;
  options.seed = seed_;
  options.stream = static_cast<uint32_t>(state_.iteration + 1);
  return options;
}

// Log-likelihoods or costs, as SearchOptions has it.
Eigen::VectorXd SimOpt::Evaluate(const Eigen::MatrixXd& samples) {
  // Without data the samples' own scatter must not move anything.
  if (CountTransitions(state_.rollouts) == 0) return Eigen::VectorXd::Constant(samples.cols(), NAN);
  const Eigen::MatrixXd physical = PhysicalColumns(robot_, samples);
  switch (*objective_) {
    case Objective::kPosterior:
      return discrepancy_.LogLikelihood(physical, state_.rollouts);
    case Objective::kStep:
      return discrepancy_.StepError(physical, Newest());
    case Objective::kTrajectory:
      return discrepancy_.TrajectoryError(physical, Newest());
  }
  throw std::logic_error("an objective that is none");
}

void SimOpt::Infer() {
  ++state_.search.update;
  if (CountTransitions(state_.rollouts) == 0) return Keep("no motion has been recorded");
  try {
    const GapFit fit = RunFromWhereItIs();
    const MethodResult& result = fit.result;
    const double kl = KlDivergence(Moments(result.posterior), Moments(state_.before));
    state_.residual = fit.gap.residual, state_.informed = fit.gap.informed;
    state_.explained = fit.explained;
    state_.information = fit.information;
    state_.alarm = fit.alarm.alarm ? fit.alarm.summary : "";
    state_.gap = fit.alarm.judged ? fit.gap.summary : fit.alarm.summary;
    state_.kl = kl;
    state_.ess = result.ess;
    state_.temperature = 1;
    state_.distribution = result.posterior;
    state_.used = result.used;
    failures_ += result.failures;
    state_.warnings = result.warnings;
  } catch (const std::invalid_argument& error) {
    Keep(error.what());
  }
}

// Whether the model explains what was recorded last, nobody can tell then.
void SimOpt::Keep(const std::string& why) {
  state_.warnings = {"the distribution stays as it is: " + why};
  state_.explained = false;
  state_.alarm.clear();
  state_.gap = state_.warnings.front();
}

// One mode leads to the next iteration's. Of several none may be given up, and in the beginning
// there is none: the search is then one from many places, the prior's mean first.
GapFit SimOpt::RunFromWhereItIs() const {
  CalibrationOptions options;
  options.method = method_;
  options.horizons = {1};
  for (const int horizon : robot_.calibration.horizons)
    options.horizons.push_back(std::min(horizon, kLongestWindow));
  std::sort(options.horizons.begin(), options.horizons.end());
  options.horizons.erase(std::unique(options.horizons.begin(), options.horizons.end()),
                         options.horizons.end());
  options.seed = seed_;
  options.execution = threads_;
  options.residual = robot_.calibration.residual;
  std::vector<Rollout> motion = state_.rollouts;
  if (KnowsLikelihood(method_)) ForgetVelocities(robot_, UnreadJoints(robot_, {}), &motion);
  const bool one_mode = state_.iteration > 0 && state_.before.components.size() == 1;
  if (one_mode) {
    try {
      const MethodInput input{model_, motion, options, state_.before.components[0].mean};
      return CloseGap(input, RunMethod(input));
    } catch (const std::invalid_argument&) {
      // perhaps it cannot be simulated where the new roll-outs went
    }
  }
  const MethodInput input{model_, motion, options};
  return CloseGap(input, RunMethod(input));
}

std::optional<CalibrationReport> SimOpt::Report() {
  if (state_.iteration == 0 || running()) return {};
  const auto newest = Newest();
  Eigen::MatrixXd physical(prior_.mean.size(), 3);
  physical << robot_.ToPhysical(Moments(state_.before).mean),
      robot_.ToPhysical(Moments(state_.distribution).mean), robot_.ToPhysical(prior_.mean);
  CalibrationReport report;
  report.iteration = state_.iteration;
  report.kl = state_.kl;
  report.ess = state_.ess;
  report.temperature = state_.temperature;
  const Eigen::VectorXd discrepancy = discrepancy_.StepError(physical, newest);
  report.discrepancy = discrepancy(1);
  report.prior_discrepancy = discrepancy(2);
  for (const int horizon : robot_.calibration.horizons) {
    const Eigen::VectorXd errors = discrepancy_.PredictionError(physical, newest, horizon);
    report.errors.push_back({horizon, errors(0), errors(1), errors(2)});
  }
  const Gaussian moments = Moments(state_.distribution);
  report.identifiability =
      state_.information.size() > 0
          ? FindIdentifiability(robot_, state_.information,
                                prior_.covariance.diagonal().cwiseSqrt(), moments)
          : FindIdentifiability(robot_, discrepancy_, state_.rollouts, moments);
  report.identifiability.summary += Doubt(state_.used, state_.ess, prior_.mean.size());
  if (state_.informed == Informed::kNone)
    report.identifiability.summary = fmt::format("no parameter is determined: {}", kNotInformed);
  report.failures = discrepancy_.failures();
  report.failures.diverged += failures_;
  report.warnings = state_.warnings;
  report.alarm = state_.alarm, report.gap = state_.gap;
  return report;
}

}  // namespace plumb
