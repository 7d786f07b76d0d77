#include "calibrator/fit/abc_methods.h"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <utility>

#include "calibrator/fit/robot_least_squares.h"
#include "calibrator/fit/robot_problem.h"
#include "calibrator/inference/abc_rejection.h"
#include "calibrator/inference/abc_smc.h"
#include "calibrator/inference/conditional_mixture.h"
#include "calibrator/inference/importance.h"
#include "common/hash.h"

namespace plumb {
namespace {

constexpr int64_t kFewestSimulators = 3000;

// The posterior that an inference has found, and a clause on how it went.
struct Inferred {
  Posterior posterior;
  std::string how;
};

// @param infer (problem, simulations) -> Inferred.
template <class Infer>
MethodResult ByApproximation(const MethodInput& input, const std::string& name,
                             const Infer& infer) {
  const RobotDescription& robot = input.model->description();
  CurriculumOptions options = CurriculumOptionsOf(input);
  options.horizons = {1};
  MethodResult result =
      FromCurriculum(input, FitCurriculum(input.model, input.rollouts, options, input.start));
  const int every = EveryFor(input, kFewestSimulators);
  // Ranks share simulators with all that becomes of their errors, and exchange a few numbers of
  // each in place of all errors: these are for whoever has made them.
  const ExecutionOptions& execution = input.options.execution;
  WindowErrors errors(input.model, input.rollouts, 1, execution.threads, every);
  errors.set_noise_sd(result.noise_sd);
  errors.Linearise(robot.ToPhysical(result.curriculum->fit.mode));
  LaplaceOptions curvature_only;
  curvature_only.max_iterations = 0;
  const LaplaceFit view =
      FitLaplace(ProblemOf(robot, errors), result.curriculum->fit.mode, curvature_only);
  Problem problem =
      RobotProblem(robot, errors, view, input.options.discrepancy, input.options.seed);
  result.simulated_steps += errors.simulated_steps();
  const int64_t simulations = std::max<int64_t>(1, input.options.budget / errors.steps());
  const Simulate simulate = problem.simulate;
  BatchRunner here;
  problem.simulate = [&](const Eigen::MatrixXd& parameters, int64_t first) {
    input.options.progress(
        name, std::min(1.0, static_cast<double>(first) / static_cast<double>(simulations)));
    return (execution.batches ? *execution.batches : here)
        .Run(Hash(parameters, Hash(name)), problem.observed.size(), parameters.cols(),
             [&](Eigen::Index begin, Eigen::Index count) {
               return simulate(parameters.middleCols(begin, count), first + begin);
             });
  };
  const auto [posterior, how] = infer(problem, simulations);
  result.curriculum.reset();  // the first fit is not the answer
  result.used = name;
  result.posterior = posterior.mixture;
  Random random = SampleStream(input);
  result.samples = posterior.samples;
  if (result.samples.cols() > kPosteriorSamples) {
    result.samples =
        Resample(posterior.samples,
                 Eigen::VectorXd::Constant(posterior.samples.cols(),
                                           1.0 / static_cast<double>(posterior.samples.cols())),
                 kPosteriorSamples, random);
  }
  result.simulated_steps += posterior.simulations * errors.steps();
  result.failures += posterior.failures;
  result.check =
      fmt::format("approximate Bayesian computation with {} simulators, discrepancy {}; {}",
                  posterior.simulations, input.options.discrepancy, how);
  if (every > 1)
    result.warnings.push_back(fmt::format(
        "{} looks at every {}th transition only, to try enough simulators within its budget", name,
        every));
  if (simulations < kFewestSimulators)
    result.warnings.push_back(fmt::format(
        "a budget of {} transitions is enough for {} simulators, where {} are few: give more",
        input.options.budget, simulations, kFewestSimulators));
  return result;
}

// Regression leads from the outcomes that were kept to what was observed. A distance of errors is
// least where they are noise, and nowhere near the zero that it would have to be led to.
bool CanAdjust(const MethodInput& input) { return input.options.discrepancy == "likelihood"; }

MethodResult AbcRejection(const MethodInput& input) {
  return ByApproximation(input, "abc-rejection", [&](const Problem& problem, int64_t simulations) {
    RejectionOptions options;
    options.simulations = simulations;
    options.fraction = 0.05;
    options.adjust = CanAdjust(input);
    RejectionDiagnostics found;
    Posterior posterior = InferByRejection(problem, options, input.options.seed, &found);
    return Inferred{
        std::move(posterior),
        fmt::format("kept the nearest {}, up to a distance of {:.3g}", found.kept, found.epsilon)};
  });
}

MethodResult AbcSmc(const MethodInput& input) {
  return ByApproximation(input, "abc-smc", [&](const Problem& problem, int64_t simulations) {
    SmcOptions options;
    options.simulations = simulations;
    options.adjust = CanAdjust(input);
    options.population = static_cast<int>(std::clamp<int64_t>(simulations / 10, 20, 500));
    SmcDiagnostics found;
    Posterior posterior = InferBySmc(problem, options, input.options.seed, &found);
    const auto& generations = found.generations;
    return Inferred{std::move(posterior),
                    generations.empty()
                        ? "nothing was accepted"
                        : fmt::format("{} generations, the last one nearer than {:.3g}",
                                      generations.size(), generations.back().epsilon)};
  });
}

MethodResult ConditionalMixture(const MethodInput& input) {
  return ByApproximation(
      input, "conditional-mixture", [&](const Problem& problem, int64_t simulations) {
        ConditionalMixtureOptions options;
        options.simulations = simulations;
        ConditionalMixtureDiagnostics found;
        Posterior posterior = InferConditionalMixture(problem, options, input.options.seed, &found);
        const auto& rounds = found.rounds;
        if (rounds.empty()) return Inferred{std::move(posterior), "one round"};
        const int components = rounds.back().components;
        return Inferred{std::move(posterior),
                        fmt::format("{} rounds, {} component{} before the last one",
                                    rounds.size() + 1, components, components == 1 ? "" : "s")};
      });
}

}  // namespace

std::vector<Method> AbcMethods() {
  return {
      {"abc-rejection",
       "approximate Bayesian computation: the nearest of many simulators, by --discrepancy",
       AbcRejection},
      {"abc-smc",
       "approximate Bayesian computation, generation by generation nearer, by --discrepancy",
       AbcSmc},
      {"conditional-mixture",
       "mixture of Gaussians over parameters and outcomes, conditioned on what was observed, by "
       "--discrepancy",
       ConditionalMixture},
  };
}

}  // namespace plumb
