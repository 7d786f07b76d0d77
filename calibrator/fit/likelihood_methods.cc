#include "calibrator/fit/likelihood_methods.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "calibrator/fit/estimated_noise.h"
#include "calibrator/fit/recorded_window.h"
#include "calibrator/fit/robot_least_squares.h"
#include "calibrator/inference/importance.h"
#include "common/decompositions.h"
#include "robot/parameter_distribution.h"
#include "sim/tasks/task.h"

namespace plumb {
namespace {

constexpr char kMixture[] = "mixture";
constexpr double kAxis = 2;  // [sd] at which the shape is checked
// drop of the log posterior there, relative to a Gaussian's
constexpr double kFlattest = 0.5, kSteepest = 2;
// of the prior's variance: above, an axis is the prior's own
constexpr double kInformed = 0.9;

MethodResult Laplace(const MethodInput& input) {
  return FromCurriculum(
      input, FitCurriculum(input.model, input.rollouts, CurriculumOptionsOf(input), input.start));
}

// The windows that a stage of the curriculum was fitted to, as it left them.
WindowErrors WindowsOf(const MethodInput& input, const CurriculumFit& curriculum, int horizon) {
  WindowErrors errors(input.model, input.rollouts, horizon, input.options.execution);
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
  const Eigen::VectorXd width = problem.prior.Width();
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
  WindowErrors errors = WindowsOf(input, curriculum, ShortestWindow(input.rollouts));
  const LeastSquares problem = ProblemOf(input.model->description(), errors);
  ImportanceOptions options;
  options.seed = input.options.seed;
  const auto affordable =
      (input.options.budget - laplace.simulated_steps - errors.simulated_steps()) /
      std::max<int64_t>(1, errors.steps() * options.rounds);
  options.samples = static_cast<int>(std::clamp<int64_t>(affordable, 50, 2000));
  options.widest = PriorGaussian(input.model->description()).covariance;
  int round = 0;
  const ImportanceFit fit = FitByImportance(
      [&](const Eigen::MatrixXd& x) {
        Eigen::VectorXd density = LogLikelihood(problem, x, curriculum.one_step.degrees_of_freedom);
        for (Eigen::Index i = 0; i < density.size(); ++i)
          density(i) += problem.prior.LogDensity(x.col(i));
        input.options.progress("importance sampling",
                               std::min(1.0, ++round / static_cast<double>(options.rounds)));
        return density;
      },
      Modes(curriculum), options);
  MethodResult result = std::move(laplace);
  result.used = kMixture;
  result.posterior = fit.mixture;
  result.ess = fit.ess;
  Random random = SampleStream(input);
  result.samples = Resample(fit.samples, fit.weights, kPosteriorSamples, random);
  result.simulated_steps += errors.simulated_steps();
  result.failures += errors.failures();
  result.check = fmt::format(
      "importance sampling of {} mode{}: {:.0f} of {} samples count, the heaviest for {:.1f} %",
      fit.mixture.components.size(), fit.mixture.components.size() == 1 ? "" : "s", fit.ess,
      fit.samples.cols(), 100 * fit.heaviest);
  if (fit.power < 1)
    result.warnings.push_back(fmt::format(
        "only {:.1f} importance samples count: the likelihood has more peaks than samples can tell "
        "apart; the posterior is as wide as where they are (power {:.2g})",
        fit.ess, fit.power));
  else if (fit.ess < 50)
    result.warnings.push_back(fmt::format(
        "only {:.0f} importance samples count: the posterior's shape is uncertain", fit.ess));
  return result;
}

MethodResult Mixture(const MethodInput& input) { return MixtureFrom(input, Laplace(input)); }

MethodResult Auto(const MethodInput& input) {
  MethodResult result = Laplace(input);
  const CurriculumFit& curriculum = *result.curriculum;
  if (!curriculum.others.empty()) return MixtureFrom(input, std::move(result));
  if (LeavesRounding(curriculum.noise_sd, MakeTask(input.model->description())->state_scale(),
                     curriculum.rows, curriculum.one_step.errors)) {
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

}  // namespace

std::vector<Method> LikelihoodMethods() {
  return {
      {"auto",
       "`laplace`, whose Gaussian is checked two standard deviations from the mode along each "
       "axis; `mixture` where it fails, or where there are several modes",
       Auto},
      {"laplace",
       "mode by Levenberg and Marquardt's method from several first guesses, noise scale and tails "
       "estimated on the way; curvature around it",
       Laplace},
      {kMixture,
       "all modes that were found, weighed and shaped by adaptive importance sampling of the "
       "one-step "
       "likelihood",
       Mixture},
  };
}

std::string Doubt(const std::string& used, double ess, Eigen::Index n) {
  if (used != kMixture || !(ess < kLeastEss * static_cast<double>(n + 1))) return {};
  return fmt::format(
      "; but how well is a guess, as the likelihood has more peaks than samples can tell apart "
      "({:.1f} of them count)",
      ess);
}

bool KnowsLikelihood(const std::string& method) {
  return std::ranges::any_of(LikelihoodMethods(),
                             [&](const Method& known) { return known.name == method; });
}

}  // namespace plumb
