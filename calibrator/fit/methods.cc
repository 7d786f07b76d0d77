#include "calibrator/fit/methods.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include "calibrator/fit/discrepancy.h"
#include "calibrator/fit/robot_problem.h"
#include "calibrator/inference/abc_rejection.h"
#include "calibrator/inference/abc_smc.h"
#include "calibrator/inference/importance.h"
#include "calibrator/inference/reps_search.h"
#include "common/config.h"
#include "common/decompositions.h"
#include "sim/tasks/task.h"

namespace plumb {
namespace {

constexpr Eigen::Index kSamples = 1000;  // of a posterior
constexpr double kAxis = 2;              // [sd] at which the shape is checked
// drop of the log posterior there, relative to a Gaussian's
constexpr double kFlattest = 0.5, kSteepest = 2;
// of the prior's variance: above, an axis is the prior's own
constexpr double kInformed = 0.9;
constexpr int64_t kFewestSimulators = 3000;  // of approximate Bayesian computation
constexpr int kFewestUpdates = 40;           // of reps: so that the KL bound lets it get anywhere

Random SampleStream(const MethodInput& input) { return Random(input.options.seed, {0x5a3b1e}); }

CurriculumOptions OptionsOf(const MethodInput& input) {
  CurriculumOptions options;
  options.horizons = input.options.horizons;
  options.seed = input.options.seed;
  options.workforce = input.options.workforce;
  options.progress = input.options.progress;
  if (input.start.size() > 0) options.starts = 1;
  return options;
}

MethodResult FromCurriculum(const MethodInput& input, CurriculumFit curriculum) {
  MethodResult result;
  result.used = "laplace";
  result.posterior = {{1}, {curriculum.fit.posterior}};
  Random random = SampleStream(input);
  result.samples = Draw(curriculum.fit, PriorOf(input.model->description()), kSamples, random);
  result.noise_sd = curriculum.noise_sd;
  result.simulated_steps = curriculum.simulated_steps;
  result.failures = curriculum.failures;
  result.warnings = curriculum.warnings;
  result.curriculum = std::move(curriculum);
  return result;
}

MethodResult Laplace(const MethodInput& input) {
  return FromCurriculum(input,
                        FitCurriculum(input.model, input.rollouts, OptionsOf(input), input.start));
}

// The windows that a stage of the curriculum was fitted to, as it left them.
WindowErrors WindowsOf(const MethodInput& input, const CurriculumFit& curriculum, int horizon) {
  WindowErrors errors(input.model, input.rollouts, horizon, input.options.workforce);
  errors.set_noise_sd(curriculum.noise_sd);
  errors.Linearise(input.model->description().ToPhysical(curriculum.fit.mode));
  return errors;
}

// How far the log posterior drops two standard deviations away, along each axis of the Gaussian,
// relative to what a Gaussian makes of it: (smallest, largest). Axes that are the prior's own need
// no check.
std::pair<double, double> AxisDrops(const LeastSquares& problem, const LaplaceFit& fit) {
  const Eigen::Index n = problem.prior.size();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(fit.standard.covariance);
  const Eigen::VectorXd width = (problem.prior.FromStandard(Eigen::VectorXd::Ones(n)) -
                                 problem.prior.FromStandard(-Eigen::VectorXd::Ones(n))) /
                                2;
  const Eigen::MatrixXd curvature =
      width.asDiagonal() * fit.information * width.asDiagonal() + Eigen::MatrixXd::Identity(n, n);
  std::vector<Eigen::VectorXd> steps{Eigen::VectorXd::Zero(n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    if (axes.eigenvalues()(i) > kInformed) continue;
    for (const double sign : {-1.0, 1.0})
      steps.push_back(sign * kAxis * std::sqrt(axes.eigenvalues()(i)) * axes.eigenvectors().col(i));
  }
  Eigen::MatrixXd points(n, static_cast<Eigen::Index>(steps.size()));
  for (size_t i = 0; i < steps.size(); ++i)
    points.col(static_cast<Eigen::Index>(i)) = fit.standard.mean + steps[i];
  const Eigen::VectorXd likelihood =
      LogLikelihood(problem, problem.prior.FromStandard(points), fit.degrees_of_freedom);
  std::pair<double, double> drops{1, 1};
  for (size_t i = 1; i < steps.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    const double drop = likelihood(0) - likelihood(at) +
                        0.5 * (points.col(at).squaredNorm() - points.col(0).squaredNorm());
    const double ratio = drop / (0.5 * steps[i].dot(curvature * steps[i]));
    drops = {std::min(drops.first, ratio), std::max(drops.second, ratio)};
  }
  return drops;
}

// Modes with the share of the posterior that Laplace's approximation gives each.
GaussianMixture Modes(const CurriculumFit& curriculum) {
  std::vector<const LaplaceFit*> fits{&curriculum.one_step};
  for (const LaplaceFit& other : curriculum.others) fits.push_back(&other);
  std::vector<double> evidence;
  GaussianMixture modes;
  for (const LaplaceFit* fit : fits) {
    const Eigen::LLT<Eigen::MatrixXd> factor(fit->posterior.covariance);
    evidence.push_back(fit->log_posterior + factor.matrixLLT().diagonal().array().log().sum());
    modes.components.push_back(fit->posterior);
  }
  const double best = *std::max_element(evidence.begin(), evidence.end());
  double sum = 0;
  for (double& e : evidence) sum += e = std::max(std::exp(e - best), 1e-3);
  for (const double e : evidence) modes.weights.push_back(e / sum);
  return modes;
}

MethodResult MixtureFrom(const MethodInput& input, MethodResult laplace) {
  const CurriculumFit& curriculum = *laplace.curriculum;
  WindowErrors errors = WindowsOf(input, curriculum, 1);
  const LeastSquares problem = ProblemOf(input.model->description(), errors);
  ImportanceOptions options;
  options.seed = input.options.seed;
  const auto affordable =
      (input.options.budget - laplace.simulated_steps - errors.simulated_steps()) /
      std::max<int64_t>(1, errors.steps() * options.rounds);
  options.samples = static_cast<int>(std::clamp<int64_t>(affordable, 50, 2000));
  int round = 0;
  const ImportanceFit fit = FitByImportance(
      [&](const Eigen::MatrixXd& x) {
        Eigen::VectorXd density = LogLikelihood(problem, x, curriculum.one_step.degrees_of_freedom);
        for (Eigen::Index i = 0; i < density.size(); ++i)
          density(i) += problem.prior.LogDensity(x.col(i));
        input.options.progress("importance sampling",
                               ++round / static_cast<double>(options.rounds));
        return density;
      },
      Modes(curriculum), options);
  MethodResult result = std::move(laplace);
  result.used = "mixture";
  result.posterior = fit.mixture;
  result.ess = fit.ess;
  Random random = SampleStream(input);
  result.samples = Resample(fit.samples, fit.weights, kSamples, random);
  result.simulated_steps += errors.simulated_steps();
  result.failures += errors.failures();
  result.check = fmt::format(
      "importance sampling of {} mode{}: {:.0f} of {} samples count, the heaviest for {:.1f} %",
      fit.mixture.components.size(), fit.mixture.components.size() == 1 ? "" : "s", fit.ess,
      fit.samples.cols(), 100 * fit.heaviest);
  if (fit.ess < 50)
    result.warnings.push_back(fmt::format(
        "only {:.0f} importance samples count: the posterior's shape is uncertain", fit.ess));
  return result;
}

MethodResult Mixture(const MethodInput& input) { return MixtureFrom(input, Laplace(input)); }

MethodResult Auto(const MethodInput& input) {
  MethodResult result = Laplace(input);
  const CurriculumFit& curriculum = *result.curriculum;
  if (!curriculum.others.empty()) return MixtureFrom(input, std::move(result));
  if ((curriculum.noise_sd.array() <=
       kNegligible * MakeTask(input.model->description())->state_scale().array())
          .all()) {
    result.check =
        "the log is explained to five digits: what is left is rounding, whose likelihood has no "
        "shape to check";
    return result;
  }
  WindowErrors errors = WindowsOf(input, curriculum, curriculum.horizon);
  const auto [flattest, steepest] =
      AxisDrops(ProblemOf(input.model->description(), errors), curriculum.fit);
  result.check = fmt::format(
      "two standard deviations away, the log posterior drops {:.2f} to {:.2f} times as far as a "
      "Gaussian's",
      flattest, steepest);
  result.simulated_steps += errors.simulated_steps();
  if (flattest >= kFlattest && steepest <= kSteepest) return result;
  MethodResult mixture = MixtureFrom(input, std::move(result));
  mixture.check = fmt::format(
      "the likelihood is no Gaussian ({:.2f} to {:.2f} times its drop at two standard deviations); "
      "{}",
      flattest, steepest, mixture.check);
  return mixture;
}

MethodResult FromSearch(const MethodInput& input, const RepsRun& run, const std::string& name) {
  MethodResult result;
  result.used = name;
  result.posterior = {{1}, {run.distribution}};
  Random random = SampleStream(input);
  result.samples =
      Transform(run.distribution, StandardNormals(run.distribution.mean.size(), kSamples, random));
  result.failures = run.failures;
  result.ess = run.ess;
  result.check = fmt::format(
      "effective sample size of the last update {:.1f}, temperature {:.3g}, {:.2f} nat from the "
      "prior",
      run.ess, run.temperature, run.kl);
  return result;
}

// Each so-manieth transition only, so that a search within the budget gets as many simulators as it
// needs.
int EveryFor(const MethodInput& input, int64_t simulators) {
  const auto transitions = static_cast<int64_t>(CountTransitions(input.rollouts));
  const int64_t affordable = std::max<int64_t>(1, input.options.budget / simulators);
  return static_cast<int>((transitions + affordable - 1) / affordable);
}

MethodResult Reps(const MethodInput& input) {
  RepsOptions options;
  options.seed = input.options.seed;
  const int every = EveryFor(input, options.samples * kFewestUpdates);
  WindowErrors errors(input.model, input.rollouts, 1, input.options.workforce, every);
  errors.Linearise(input.model->description().ToPhysical(
      PriorOf(input.model->description())
          .FromStandard(Eigen::VectorXd::Zero(errors.parameter_count()))));
  const LeastSquares problem = ProblemOf(input.model->description(), errors);
  const int affordable = static_cast<int>(input.options.budget /
                                          std::max<int64_t>(1, options.samples * errors.steps()));
  options.updates = std::max(1, std::min(affordable, 4 * kFewestUpdates));
  const RepsRun run = RepsSearch(
      problem.prior, [&](const Eigen::MatrixXd& x) { return LogLikelihood(problem, x); }, options,
      [&](int update) {
        input.options.progress("reps", update / static_cast<double>(options.updates));
      });
  MethodResult result = FromSearch(input, run, "reps");
  result.simulated_steps = errors.simulated_steps();
  if (every > 1) {
    result.warnings.push_back(
        fmt::format("reps looks at each {}th transition only, to make {} updates within its budget",
                    every, options.updates));
  }
  if (run.temperature > 1.5)
    result.warnings.push_back(
        "reps ran out of updates before it came to rest: its width is not a posterior's");
  return result;
}

MethodResult Simopt(const MethodInput& input) {
  RepsOptions options;
  options.returns = RepsReturns::kUnitRange;
  options.min_temperature = 0.01;
  options.seed = input.options.seed;
  const auto transitions = static_cast<int64_t>(CountTransitions(input.rollouts));
  options.updates = static_cast<int>(std::max<int64_t>(
      1, input.options.budget / (options.samples * std::max<int64_t>(1, transitions))));
  const RobotDescription& robot = input.model->description();
  Discrepancy discrepancy(robot, input.options.workforce);
  const RepsRun run = RepsSearch(
      PriorOf(robot),
      [&](const Eigen::MatrixXd& x) {
        Eigen::MatrixXd physical(x.rows(), x.cols());
        for (Eigen::Index i = 0; i < x.cols(); ++i) physical.col(i) = robot.ToPhysical(x.col(i));
        return discrepancy.TrajectoryError(physical, input.rollouts);
      },
      options,
      [&](int update) {
        input.options.progress("simopt", update / static_cast<double>(options.updates));
      });
  MethodResult result = FromSearch(input, run, "simopt");
  result.simulated_steps = run.simulations * transitions;
  result.warnings.push_back("simopt's distribution is the width of its search, not a posterior");
  return result;
}

template <class Infer>
MethodResult ByApproximation(const MethodInput& input, const std::string& name,
                             const Infer& infer) {
  const RobotDescription& robot = input.model->description();
  CurriculumOptions options = OptionsOf(input);
  options.horizons = {1};
  MethodResult result =
      FromCurriculum(input, FitCurriculum(input.model, input.rollouts, options, input.start));
  const int every = EveryFor(input, kFewestSimulators);
  WindowErrors errors(input.model, input.rollouts, 1, input.options.workforce, every);
  errors.set_noise_sd(result.noise_sd);
  errors.Linearise(robot.ToPhysical(result.curriculum->fit.mode));
  LaplaceOptions still;
  still.most_iterations = 0;
  const LaplaceFit view = FitLaplace(ProblemOf(robot, errors), result.curriculum->fit.mode, still);
  Problem problem =
      RobotProblem(robot, errors, view, input.options.discrepancy, input.options.seed);
  // the first fit counts, too
  const int64_t left = input.options.budget - result.simulated_steps - errors.simulated_steps();
  const int64_t simulations = std::max<int64_t>(1, left / errors.steps());
  const Simulate simulate = problem.simulate;
  problem.simulate = [&](const Eigen::MatrixXd& parameters, int64_t first) {
    input.options.progress(
        name, std::min(1.0, static_cast<double>(first) / static_cast<double>(simulations)));
    return simulate(parameters, first);
  };
  const Posterior posterior = infer(problem, simulations);
  result.curriculum.reset();  // the first fit is not the answer
  result.used = name;
  result.posterior = posterior.mixture;
  Random random = SampleStream(input);
  result.samples = posterior.samples;
  if (result.samples.cols() > kSamples) {
    result.samples =
        Resample(posterior.samples,
                 Eigen::VectorXd::Constant(posterior.samples.cols(),
                                           1.0 / static_cast<double>(posterior.samples.cols())),
                 kSamples, random);
  }
  result.simulated_steps += errors.simulated_steps();
  result.failures += posterior.failures;
  result.check = fmt::format("approximate Bayesian computation with {} simulators, discrepancy {}",
                             posterior.simulations, input.options.discrepancy);
  if (every > 1)
    result.warnings.push_back(fmt::format(
        "{} looks at each {}th transition only, to try enough simulators within its budget", name,
        every));
  return result;
}

MethodResult AbcRejection(const MethodInput& input) {
  return ByApproximation(input, "abc-rejection", [&](const Problem& problem, int64_t simulations) {
    RejectionOptions options;
    options.simulations = simulations;
    options.fraction = 0.05;
    return InferByRejection(problem, options, input.options.seed);
  });
}

MethodResult AbcSmc(const MethodInput& input) {
  return ByApproximation(input, "abc-smc", [&](const Problem& problem, int64_t simulations) {
    SmcOptions options;
    options.simulations = simulations;
    options.population = static_cast<int>(std::clamp<int64_t>(simulations / 10, 20, 500));
    return InferBySmc(problem, options, input.options.seed);
  });
}

using Method = MethodResult (*)(const MethodInput&);
const std::vector<std::pair<std::string, Method>>& Methods() {
  static const std::vector<std::pair<std::string, Method>> methods{
      {"auto", Auto},     {"laplace", Laplace}, {"mixture", Mixture},
      {"reps", Reps},     {"simopt", Simopt},   {"abc-rejection", AbcRejection},
      {"abc-smc", AbcSmc}};
  return methods;
}

}  // namespace

const std::vector<std::string>& CalibrationMethods() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const auto& [name, method] : Methods()) all.push_back(name);
    return all;
  }();
  return names;
}

void RequireMethod(const std::string& wanted) {
  const auto& names = CalibrationMethods();
  if (std::find(names.begin(), names.end(), wanted) != names.end()) return;
  const std::string nearest =
      *std::min_element(names.begin(), names.end(), [&](const auto& a, const auto& b) {
        return EditDistance(a, wanted) < EditDistance(b, wanted);
      });
  throw std::invalid_argument("there is no method '" + wanted + "'; did you mean '" + nearest +
                              "'?");
}

MethodResult RunMethod(const MethodInput& input) {
  RequireMethod(input.options.method);
  const auto& methods = Methods();
  const auto is_wanted = [&](const auto& method) { return method.first == input.options.method; };
  return std::find_if(methods.begin(), methods.end(), is_wanted)->second(input);
}

}  // namespace plumb
