#include "calibrator/gap/gap.h"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>
#include <vector>

#include "calibrator/fit/likelihood_methods.h"
#include "calibrator/fit/methods.h"
#include "calibrator/fit/robot_draws.h"
#include "calibrator/fit/robot_least_squares.h"
#include "calibrator/inference/gaussian_mixture.h"
#include "robot/parameter_distribution.h"
#include "sim/tasks/task.h"

namespace plumb {
namespace {

constexpr uint32_t kDrawStream = 0x4761'7044;  // of random numbers; "GapD"

double MeanExplained(const ResidualQuality& quality) {
  const Eigen::VectorXd explained = Explained(quality);
  return explained.size() == 0 ? 0 : explained.mean();
}

// Whether a residual makes errors much smaller, and makes them smaller by an amount that counts.
bool Worth(const ResidualQuality& quality, const Eigen::VectorXd& units) {
  if (MeanExplained(quality) < kLeastExplained) return false;
  const Eigen::ArrayXd explained =
      (quality.before.array().square() - quality.after.array().square()).max(0).sqrt();
  return (explained / units.array()).maxCoeff() >= kLeastEffect;
}

using Contacts = ResidualFitOptions::Contacts;

// An alarm tells of every error that is no accident, however small: of those that an integrator's
// step makes, too, where states are known to six digits.
bool Matters(const MethodInput& input, const MethodResult& result,
             Contacts contacts = Contacts::kLearnt) {
  const ResidualFit fit = FitResidual(input.model, Moments(result.posterior).mean, input.rollouts,
                                      {.contacts = contacts, .seed = input.options.seed});
  const Eigen::VectorXd units =
      MakeTask(input.model->description())->state_scale().tail(input.model->num_velocities());
  return Worth(fit.free, units) || Worth(fit.touching, units);
}

// Mean squared whitened error: what bus and observer make of a right model's is 0.4 to 1.3.
constexpr double kLittleMore = 2;

constexpr char kNotLearnt[] = "what the model lacks is not learnt: ";

// Why nothing is learnt of what the model lacks; empty = it is.
std::string Obstacle(const MethodInput& input) {
  if (!input.options.residual) return "residuals are switched off";
  if (!KnowsLikelihood(input.options.method))
    return fmt::format("{} does not know the likelihood of steps, as auto does",
                       input.options.method);
  return "";
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
  Random random(input.options.seed, {kDrawStream});
  Eigen::MatrixXd draws(distribution.size(), kResidualDraws);
  draws << Moments(posterior).mean, DrawRobots(*input.model, kResidualDraws - 1, [&] {
    return distribution.SampleCoordinates(random);
  });
  return draws;
}

std::string InWords(const char* where, const ResidualQuality& quality) {
  return fmt::format("{} {} steps {:.0f} % of the velocities' squared errors", quality.transitions,
                     where, 100 * MeanExplained(quality));
}

// In which steps the model does not explain what was recorded.
struct Lacking {
  bool free, touching;
};

std::string Unexplained(const Lacking& lacking, Informed by) {
  const char* what = !lacking.free      ? "does not explain contact"
                     : lacking.touching ? "explains neither free motion nor contact"
                                        : "does not explain the motion";
  const char* informed = by == Informed::kNone ? "nothing informs its parameters"
                         : by == Informed::kFree
                             ? "its parameters are learnt from free motion alone"
                             : "its parameters are learnt from what contacts cannot have done";
  return fmt::format("the model {}: {}", what, informed);
}

std::string Summarise(const Gap& gap) {
  std::string text = gap.unexplained;
  if (!gap.residual) return text + "; too little was recorded to learn what it lacks";
  text += "; of what it lacks, the learnt residual explains, of ";
  std::string parts;
  if (gap.residual->free) parts += InWords("free", gap.free);
  if (gap.residual->touching)
    parts += (parts.empty() ? "" : ", of ") + InWords("touching", gap.touching);
  return text + parts;
}

// A posterior of other covariances than the method's.
void Take(const MethodInput& input, const GaussianMixture& considered, GapFit* fit) {
  const Eigen::VectorXd prior_precision =
      PriorGaussian(input.model->description()).covariance.diagonal().cwiseInverse();
  const Eigen::MatrixXd covariance = Moments(considered).covariance;
  const Eigen::Index n = covariance.rows();
  fit->information = covariance.llt().solve(Eigen::MatrixXd::Identity(n, n));
  fit->information.diagonal() -= prior_precision;
  fit->result.posterior = considered;
  Random random = SampleStream(input);
  fit->result.samples =
      considered.components.size() == 1
          ? Transform(considered.components[0], StandardNormals(n, kPosteriorSamples, random))
          : Sample(considered, kPosteriorSamples, random);
}

// The method on a part of what was recorded. @return false if the model does not explain that,
// either, and by an amount that counts.
bool LearnFrom(const MethodInput& part, Contacts contacts, GapFit* fit) {
  try {
    MethodResult result = RunMethod(part);
    const OneStepView view = ViewOneStep(part, result);
    fit->simulated_steps += view.simulated_steps;
    const ModelTest test = TestModel(part, result, view, &fit->simulated_steps);
    if (test.found.alarm && Matters(part, result, contacts)) {
      fit->result.simulated_steps += result.simulated_steps;
      fit->result.failures += result.failures;
      return false;
    }
    result.simulated_steps += fit->result.simulated_steps;
    result.failures += fit->result.failures;
    fit->result = std::move(result);
    Take(part, test.considered, fit);
    return true;
  } catch (const std::invalid_argument&) {
    return false;
  }
}

// The method on all steps, contacts set aside: in directions and sizes that depend on the
// parameters, for which a first guess by single steps is enough.
bool LearnBesideContacts(const MethodInput& input, GapFit* fit) {
  Eigen::VectorXd mean = Moments(fit->result.posterior).mean;
  CalibrationOptions quick = input.options;
  quick.method = "laplace", quick.horizons = {1};
  try {
    const std::vector<Rollout> first =
        InformingSteps(input.model, mean, input.rollouts, Informed::kBesideContacts);
    MethodResult result = RunMethod({input.model, first, quick, mean});
    fit->result.simulated_steps += result.simulated_steps;
    fit->result.failures += result.failures;
    mean = Moments(result.posterior).mean;
    const std::vector<Rollout> steps =
        InformingSteps(input.model, mean, input.rollouts, Informed::kBesideContacts);
    if (!LearnFrom({input.model, steps, input.options, mean}, Contacts::kSetAside, fit))
      return false;
    GaussianMixture wider = fit->result.posterior;
    for (Gaussian& component : wider.components)
      component.covariance *= kContactsLeave * kContactsLeave;
    Take(input, wider, fit);
    return true;
  } catch (const std::invalid_argument&) {
    return false;
  }
}

// The method on those steps that the model explains; the prior where there are none.
Lacking LearnFromExplained(const MethodInput& input, GapFit* fit) {
  const std::vector<Rollout> steps = FreeSteps(input.model->description(), input.rollouts);
  const size_t free_count = CountTransitions(steps);
  const bool touching = free_count < CountTransitions(input.rollouts),
             enough = free_count >= static_cast<size_t>(kFewestFree);
  const bool explained =
      touching && enough &&
      LearnFrom({input.model, steps, input.options, input.start}, Contacts::kLearnt, fit);
  // of too few free steps nothing is known
  const bool free = !touching || (enough && !explained);
  const bool beside = touching && !free && LearnBesideContacts(input, fit);
  fit->gap.informed = beside      ? Informed::kBesideContacts
                      : explained ? Informed::kFree
                                  : Informed::kNone;
  if (fit->gap.informed == Informed::kNone) {
    fit->result = PriorAlone(input, std::move(fit->result));
    fit->information.setZero();
  }
  return {free, touching};
}

void LearnResidual(const MethodInput& input, const Lacking& lacking, GapFit* fit) {
  ResidualFitOptions options;
  options.free = lacking.free, options.touching = lacking.touching;
  options.seed = input.options.seed;
  ResidualFit residual =
      FitResidual(input.model, Draws(input, fit->result.posterior), input.rollouts, options);
  fit->gap.free = residual.free, fit->gap.touching = residual.touching;
  if (residual.residual.free || residual.residual.touching)
    fit->gap.residual = std::make_shared<const Residual>(std::move(residual.residual));
}

}  // namespace

Eigen::VectorXd Explained(const ResidualQuality& quality) {
  const Eigen::ArrayXd before = quality.before.array().square(),
                       after = quality.after.array().square();
  return (1 - after / before.max(1e-300)).max(0);
}

void LeaveOut(const std::string& why, Gap* gap) {
  gap->residual = nullptr;
  gap->free = gap->touching = {};
  gap->summary = gap->unexplained + "; " + why;
}

GapFit CloseGap(const MethodInput& input, MethodResult all, const std::string& not_judged) {
  GapFit fit;
  fit.view = ViewOneStep(input, all);
  fit.simulated_steps += fit.view.simulated_steps;
  ModelTest test = TestModel(input, all, fit.view, &fit.simulated_steps);
  if (not_judged.empty())
    fit.alarm = std::move(test.found);
  else
    fit.alarm.judged = false, fit.alarm.summary = not_judged;
  fit.information = fit.view.information;
  fit.result = std::move(all);
  if (!fit.alarm.judged && KnowsLikelihood(input.options.method))
    Take(input, test.considered, &fit);
  fit.explained = fit.alarm.judged && !fit.alarm.alarm;
  if (!fit.alarm.alarm) return fit;
  if (const std::string obstacle = Obstacle(input); !obstacle.empty()) {
    fit.gap.summary = kNotLearnt + obstacle;
    return fit;
  }
  if (!Matters(input, fit.result)) {
    fit.gap.summary = fmt::format(
        "{}a residual would explain less than {:.0f} % of the velocities' squared errors, or too "
        "little to matter; the parameters are as unsure as what may be wrong with the model makes "
        "them",
        kNotLearnt, 100 * kLeastExplained);
    // Of what is neither noise nor learnt nobody knows that it does not matter.
    fit.explained = MeanSquaredError(fit.view) <= kLittleMore;
    Take(input, test.considered, &fit);
    return fit;
  }
  const Lacking lacking = LearnFromExplained(input, &fit);
  LearnResidual(input, lacking, &fit);
  fit.gap.unexplained = Unexplained(lacking, fit.gap.informed);
  fit.gap.summary = Summarise(fit.gap);
  return fit;
}

}  // namespace plumb
