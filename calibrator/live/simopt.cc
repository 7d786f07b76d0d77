#include "calibrator/live/simopt.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "calibrator/inference/reps.h"
#include "common/random.h"
#include "robot/parameter_distribution.h"

namespace plumb {
namespace {

// Where the paper's objectives end in costs mapped to [0, 1] (table of Cui & Hensel).
constexpr double kScaledMinTemperature = 0.01;

// [control steps] beyond which one-step models of robots do not hold
constexpr int kLongestWindow = 50;

std::optional<Objective> SearchOf(const std::string& method) {
  if (method == "reps") return Objective::kPosterior;
  if (method == "simopt") return Objective::kTrajectory;
  return {};
}

// Costs c -> -(c - min) / (max - min); infinitely costly samples stay so.
Eigen::VectorXd ScaledReturns(const Eigen::VectorXd& costs) {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (const double cost : costs) {
    if (!std::isfinite(cost)) continue;
    low = std::min(low, cost);
    high = std::max(high, cost);
  }
  if (!std::isfinite(low)) return Eigen::VectorXd::Constant(costs.size(), low > 0 ? -low : low);
  return -(costs.array() - low) / std::max(high - low, std::numeric_limits<double>::min());
}

}  // namespace

Gaussian PriorGaussian(const RobotDescription& robot) {
  const ParameterDistribution prior = ParameterDistribution::Prior(robot);
  return {prior.components[0].mean, prior.components[0].covariance};
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
      objective_(SearchOf(method)),
      model_(std::make_shared<Model>(robot)),
      prior_(PriorGaussian(robot)),
      discrepancy_(robot, threads) {
  RequireMethod(method);
  state_.distribution = state_.before = {{1}, {prior_}};
}

SimOpt::~SimOpt() = default;

void SimOpt::Resume(State state) {
  for (const GaussianMixture* mixture : {&state.distribution, &state.before}) {
    for (const Gaussian& component : mixture->components) {
      if (component.mean.size() == prior_.mean.size() &&
          component.covariance.rows() == prior_.mean.size())
        continue;
      throw std::invalid_argument("the checkpoint has another number of parameters than the robot");
    }
  }
  state_ = std::move(state);
}

bool SimOpt::running() const {
  return static_cast<int>(state_.rollouts_per_iteration.size()) > state_.iteration;
}

void SimOpt::Begin(std::vector<Rollout> rollouts) {
  if (running()) throw std::invalid_argument("a calibration is running");
  state_.rollouts_per_iteration.push_back(static_cast<int>(rollouts.size()));
  for (Rollout& rollout : rollouts) state_.rollouts.push_back(std::move(rollout));
  state_.before = state_.distribution;
  state_.update = 0;
  state_.kl = 0;
}

std::span<const Rollout> SimOpt::Newest() const {
  const auto count = static_cast<size_t>(state_.rollouts_per_iteration.back());
  return std::span(state_.rollouts).last(count);
}

Eigen::MatrixXd SimOpt::Samples(int iteration, int update) const {
  Eigen::MatrixXd normals(prior_.mean.size(), robot_.calibration.samples);
  for (Eigen::Index i = 0; i < normals.cols(); ++i) {
    Random random(seed_, {static_cast<uint32_t>(iteration), static_cast<uint32_t>(update),
                          static_cast<uint32_t>(i)});
    for (Eigen::Index j = 0; j < normals.rows(); ++j) normals(j, i) = random.Normal();
  }
  return Transform(Moments(state_.distribution), normals);
}

Eigen::VectorXd SimOpt::Returns(const Eigen::MatrixXd& samples) {
  // Without data the samples' own scatter must not move anything.
  if (CountTransitions(state_.rollouts) == 0) return Eigen::VectorXd::Constant(samples.cols(), NAN);
  Eigen::MatrixXd physical(samples.rows(), samples.cols());
  for (Eigen::Index i = 0; i < samples.cols(); ++i)
    physical.col(i) = robot_.ToPhysical(samples.col(i));
  Eigen::VectorXd values;
  switch (*objective_) {
    case Objective::kPosterior:
      values = discrepancy_.LogLikelihood(physical, state_.rollouts);
      break;
    case Objective::kStep:
      values = discrepancy_.StepError(physical, Newest());
      break;
    case Objective::kTrajectory:
      values = discrepancy_.TrajectoryError(physical, Newest());
      break;
  }
  if (objective_ != Objective::kPosterior) return ScaledReturns(values);
  const Gaussian present = Moments(state_.distribution);
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    values(i) += LogDensity(prior_, samples.col(i)) - LogDensity(present, samples.col(i));
  }
  return values;
}

std::optional<CalibrationReport> SimOpt::Update() {
  warnings_.clear();
  objective_ ? Search() : Infer();
  if (++state_.update < (objective_ ? robot_.calibration.updates : 1)) return {};
  ++state_.iteration;
  return Report();
}

void SimOpt::Search() {
  const Eigen::MatrixXd samples = Samples(state_.iteration + 1, state_.update);
  const Eigen::VectorXd returns = Returns(samples);
  // nothing is known: keep it
  if (returns.array().isNaN().any() || !std::isfinite(returns.maxCoeff())) return;
  const double coldest = objective_ == Objective::kPosterior ? robot_.calibration.min_temperature
                                                             : kScaledMinTemperature;
  const RepsWeights weights = SolveReps(returns, robot_.calibration.kl, coldest);
  const Gaussian present = Moments(state_.distribution);
  const Gaussian limited =
      LimitKl(present, FitGaussian(samples, weights, present), robot_.calibration.kl);
  state_.kl += KlDivergence(limited, present);
  state_.ess = weights.ess;
  state_.temperature = weights.temperature;
  state_.distribution = {{1}, {limited}};
}

void SimOpt::Infer() {
  if (CountTransitions(state_.rollouts) == 0) return;  // nothing is known: keep it
  try {
    const MethodResult result = RunFromWhereItIs();
    state_.kl = KlDivergence(Moments(result.posterior), Moments(state_.before));
    state_.ess = result.ess;
    state_.temperature = 1;
    state_.distribution = result.posterior;
    failures_ += result.failures;
    warnings_ = result.warnings;
  } catch (const std::invalid_argument& error) {
    warnings_ = {std::string("the distribution stays as it is: ") + error.what()};
  }
}

// One mode leads to the next iteration's. Of several none may be given up, and in the beginning
// there is none: the search is then one from many places, the prior's mean first.
MethodResult SimOpt::RunFromWhereItIs() const {
  CalibrationOptions options;
  options.method = method_;
  options.horizons = {1};
  for (const int horizon : robot_.calibration.horizons)
    options.horizons.push_back(std::min(horizon, kLongestWindow));
  std::sort(options.horizons.begin(), options.horizons.end());
  options.horizons.erase(std::unique(options.horizons.begin(), options.horizons.end()),
                         options.horizons.end());
  options.seed = seed_;
  options.workforce = threads_;
  const bool one_mode = state_.iteration > 0 && state_.before.components.size() == 1;
  if (one_mode) {
    try {
      return RunMethod({model_, state_.rollouts, options, state_.before.components[0].mean});
      // perhaps it cannot be simulated where the new roll-outs went
    } catch (const std::invalid_argument&) {
    }
  }
  return RunMethod({model_, state_.rollouts, options});
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
  report.identifiability =
      FindIdentifiability(robot_, discrepancy_, state_.rollouts, Moments(state_.distribution));
  report.failures = discrepancy_.failures();
  report.failures.diverged += failures_;
  report.warnings = warnings_;
  return report;
}

}  // namespace plumb
