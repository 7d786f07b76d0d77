#include "calibrator/fit/search_methods.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "calibrator/fit/discrepancy.h"
#include "calibrator/fit/physical_columns.h"
#include "calibrator/fit/robot_least_squares.h"
#include "calibrator/inference/reps_search.h"

namespace plumb {
namespace {

constexpr int kFewestUpdates = 40;  // of reps: so that the KL bound lets it get anywhere

MethodResult FromSearch(const MethodInput& input, const RepsState& run, const std::string& name) {
  MethodResult result;
  result.used = name;
  result.posterior = {{1}, {run.distribution}};
  Random random = SampleStream(input);
  result.samples = Transform(
      run.distribution, StandardNormals(run.distribution.mean.size(), kPosteriorSamples, random));
  result.failures = run.failures;
  result.ess = run.ess;
  result.check = fmt::format(
      "effective sample size of the last update {:.1f}, temperature {:.3g}, {:.2f} nat from the "
      "prior",
      run.ess, run.temperature, run.kl);
  return result;
}

MethodResult Reps(const MethodInput& input) {
  RepsOptions options;
  options.seed = input.options.seed;
  const int every = EveryFor(input, int64_t{options.samples} * kFewestUpdates);
  WindowErrors errors(input.model, input.rollouts, 1, input.options.execution, every);
  errors.Linearise(input.model->description().ToPhysical(
      PriorOf(input.model->description())
          .FromStandard(Eigen::VectorXd::Zero(errors.parameter_count()))));
  const LeastSquares problem = ProblemOf(input.model->description(), errors);
  const int64_t affordable =
      input.options.budget / std::max<int64_t>(1, options.samples * errors.steps());
  const auto updates =
      static_cast<int>(std::clamp<int64_t>(affordable, 1, int64_t{4} * kFewestUpdates));
  const RepsState run = SearchByReps(
      problem.prior, [&](const Eigen::MatrixXd& x) { return LogLikelihood(problem, x); }, options,
      updates,
      [&](int update) { input.options.progress("reps", update / static_cast<double>(updates)); });
  MethodResult result = FromSearch(input, run, "reps");
  result.simulated_steps = errors.simulated_steps();
  if (every > 1) {
    result.warnings.push_back(fmt::format(
        "reps looks at every {}th transition only, to make {} updates within its budget", every,
        updates));
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
  const int64_t affordable =
      input.options.budget / (options.samples * std::max<int64_t>(1, transitions));
  const auto updates =
      static_cast<int>(std::clamp<int64_t>(affordable, 1, std::numeric_limits<int>::max()));
  const RobotDescription& robot = input.model->description();
  Discrepancy discrepancy(robot, input.options.execution);
  const RepsState run = SearchByReps(
      PriorOf(robot),
      [&](const Eigen::MatrixXd& x) {
        return discrepancy.TrajectoryError(PhysicalColumns(robot, x), input.rollouts);
      },
      options, updates,
      [&](int update) { input.options.progress("simopt", update / static_cast<double>(updates)); });
  MethodResult result = FromSearch(input, run, "simopt");
  result.simulated_steps = int64_t{updates} * options.samples * transitions;
  result.warnings.push_back("simopt's distribution is the width of its search, not a posterior");
  return result;
}

}  // namespace

std::vector<Method> SearchMethods() {
  return {
      {"reps",
       "step-based SimOpt: relative-entropy policy search with a bound on the Gaussian's own KL "
       "divergence",
       Reps},
      {"simopt",
       "the original: whole trajectories, smoothed; its width is its search's, not a posterior's",
       Simopt},
  };
}

}  // namespace plumb
