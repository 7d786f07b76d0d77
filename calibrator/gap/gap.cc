#include "calibrator/gap/gap.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "calibrator/diagnostics/model_test.h"
#include "calibrator/fit/methods.h"
#include "calibrator/fit/robot_least_squares.h"
#include "robot/parameter_distribution.h"
#include "sim/touch.h"

namespace plumb {
namespace {

constexpr uint32_t kDrawStream = 0x4761'7044;  // of random numbers; "GapD"

Misspecification Test(const MethodInput& input, const MethodResult& result, int64_t* steps) {
  const OneStepView view = ViewOneStep(input, result);
  *steps += view.simulated_steps;
  return TestModel(input, result, view, steps);
}

std::vector<Rollout> FreeOnly(const RobotDescription& robot, std::span<const Rollout> rollouts) {
  TouchFinder touch(robot, Residual::kTouchMargin);
  std::vector<Rollout> free(rollouts.begin(), rollouts.end());
  for (Rollout& rollout : free) {
    std::erase_if(rollout.transitions, [&](const Transition& t) {
      return touch.Find(t.q).any() || (t.next_q.allFinite() && touch.Find(t.next_q).any());
    });
  }
  return free;
}

// Mean share of a velocity's squared errors that a residual explains, left-out transitions judging.
double Explained(const ResidualQuality& quality) {
  if (quality.before.size() == 0) return 0;
  const Eigen::ArrayXd before = quality.before.array().square(),
                       after = quality.after.array().square();
  return (1 - after / before.max(1e-300)).max(0).mean();
}

// An alarm tells of every error that is no accident, however small: of the tenth of a per cent that
// an integrator's step makes, too. What a residual cannot make much smaller is not worth one.
bool Matters(const MethodInput& input, const MethodResult& result) {
  const ResidualFit fit = FitResidual(input.model, Moments(result.posterior).mean, input.rollouts,
                                      {.seed = input.options.seed});
  return std::max(Explained(fit.free), Explained(fit.touching)) >= kLeastExplained;
}

MethodResult PriorAlone(const MethodInput& input, MethodResult all) {
  const Prior prior = PriorOf(input.model->description());
  MethodResult result;
  result.used = "prior";
  result.posterior = {{1}, {PriorGaussian(input.model->description())}};
  Random random = SampleStream(input);
  result.samples = prior.Sample(kPosteriorSamples, random);
  result.check = "nothing informs the parameters: this is the prior";
  result.warnings = std::move(all.warnings);
  result.simulated_steps = all.simulated_steps, result.failures = all.failures;
  return result;
}

// Columns: the mean, then draws.
Eigen::MatrixXd Draws(const MethodInput& input, const GaussianMixture& posterior) {
  const ParameterDistribution distribution{0, input.model->description().parameters, posterior};
  Eigen::MatrixXd draws(distribution.size(), kResidualDraws);
  draws.col(0) = Moments(posterior).mean;
  Random random(input.options.seed, {kDrawStream});
  for (Eigen::Index k = 1; k < draws.cols(); ++k)
    draws.col(k) = distribution.SampleCoordinates(random);
  return draws;
}

std::string Explained(const char* where, const ResidualQuality& quality) {
  return fmt::format("{} {} steps {:.0f} % of the velocities' squared errors", quality.transitions,
                     where, 100 * Explained(quality));
}

std::string Summarise(const GapFit& gap) {
  std::string text = gap.free ? "neither free motion nor contact" : "contact";
  if (gap.free && !gap.touching) text = "the motion";
  text = fmt::format("the model does not explain {}: {}", text,
                     gap.free ? "nothing informs its parameters"
                              : "its parameters are learnt from free motion alone");
  if (!gap.residual) return text + "; too little was recorded to learn what it lacks";
  text += "; of what it lacks, the learnt residual explains, of ";
  std::string parts;
  if (gap.residual->free) parts += Explained("free", gap.free_quality);
  if (gap.residual->touching)
    parts += (parts.empty() ? "" : ", of ") + Explained("touching", gap.touching_quality);
  return text + parts;
}

}  // namespace

GapFit CloseGap(const MethodInput& input, MethodResult all) {
  GapFit gap;
  gap.alarm = Test(input, all, &gap.simulated_steps);
  gap.result = std::move(all);
  if (!gap.alarm.alarm || !Matters(input, gap.result)) return gap;
  const std::vector<Rollout> free = FreeOnly(input.model->description(), input.rollouts);
  const size_t free_count = CountTransitions(free);
  gap.touching = free_count < CountTransitions(input.rollouts);
  gap.free = !gap.touching;
  if (gap.touching && free_count >= static_cast<size_t>(kFewestFree)) {
    const MethodInput part{input.model, free, input.options, input.start};
    try {
      MethodResult result = RunMethod(part);
      gap.free = Test(part, result, &gap.simulated_steps).alarm;
      result.simulated_steps += gap.result.simulated_steps;
      result.failures += gap.result.failures;
      if (!gap.free) gap.result = std::move(result);
    } catch (const std::invalid_argument&) {
      gap.free = true;
    }
  }
  const bool uninformed = gap.free || free_count < static_cast<size_t>(kFewestFree);
  if (uninformed) gap.result = PriorAlone(input, std::move(gap.result));
  ResidualFitOptions options;
  options.free = gap.free, options.touching = gap.touching;
  options.seed = input.options.seed;
  ResidualFit fit =
      FitResidual(input.model, Draws(input, gap.result.posterior), input.rollouts, options);
  gap.free_quality = fit.free, gap.touching_quality = fit.touching;
  if (fit.residual.free || fit.residual.touching)
    gap.residual = std::make_shared<const Residual>(std::move(fit.residual));
  gap.summary = Summarise(gap);
  return gap;
}

}  // namespace plumb
