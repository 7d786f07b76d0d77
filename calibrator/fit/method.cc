#include "calibrator/fit/method.h"
#include "calibrator/fit/robot_least_squares.h"

#include <algorithm>

namespace plumb {

Random SampleStream(const MethodInput& input) { return Random(input.options.seed, {0x5a3b1e}); }

CurriculumOptions CurriculumOptionsOf(const MethodInput& input) {
  CurriculumOptions options;
  options.horizons = input.options.horizons;
  options.seed = input.options.seed;
  options.execution = input.options.execution;
  options.progress = input.options.progress;
  if (input.start.size() > 0) options.starts = 1;
  return options;
}

MethodResult FromCurriculum(const MethodInput& input, CurriculumFit curriculum) {
  MethodResult result;
  result.used = "laplace";
  result.posterior = {{1}, {curriculum.fit.posterior}};
  Random random = SampleStream(input);
  result.samples =
      Draw(curriculum.fit, PriorOf(input.model->description()), kPosteriorSamples, random);
  result.noise_sd = curriculum.noise_sd;
  result.simulated_steps = curriculum.simulated_steps;
  result.failures = curriculum.failures;
  result.warnings = curriculum.warnings;
  result.curriculum = std::move(curriculum);
  return result;
}

int EveryFor(const MethodInput& input, int64_t simulators) {
  const auto transitions = static_cast<int64_t>(CountTransitions(input.rollouts));
  const int64_t affordable = std::max<int64_t>(1, input.options.budget / simulators);
  return static_cast<int>((transitions + affordable - 1) / affordable);
}

}  // namespace plumb
