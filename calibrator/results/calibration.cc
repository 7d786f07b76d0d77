#include "calibrator/results/calibration.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <stdexcept>

#include "calibrator/design/excitation.h"
#include "calibrator/diagnostics/finer_steps.h"
#include "calibrator/diagnostics/holdout.h"
#include "calibrator/diagnostics/shifted_efforts.h"
#include "calibrator/fit/likelihood_methods.h"
#include "calibrator/fit/methods.h"
#include "calibrator/fit/physical_columns.h"
#include "calibrator/fit/recorded_window.h"
#include "calibrator/gap/gap.h"
#include "calibrator/motion/differences.h"
#include "calibrator/motion/still_readings.h"
#include "calibrator/results/summary.h"
#include "common/time_units.h"
#include "robot/parameter_distribution.h"

namespace plumb {
namespace {

constexpr char kCure[] =
    "; train on posterior and residual together (plumb train --distribution), and, as a residual "
    "is right only near what it was learnt from, record the trained policy's motion and calibrate "
    "with all logs";

// Times the error without it; less may be chance.
constexpr double kHarm = 1.1;

class Calibration {
 public:
  Calibration(const RobotDescription& robot, std::span<const Log> logs,
              const CalibrationOptions& options)
      : robot_(robot), model_(std::make_shared<Model>(robot)), logs_(logs), options_(options) {
    for (const Log& log : logs) own_.push_back(Motion(log));
    for (const std::vector<Rollout>& own : own_)
      rollouts_.insert(rollouts_.end(), own.begin(), own.end());
    still_ = ForgetStill(robot, &rollouts_);
    for (std::vector<Rollout>& own : own_) ForgetStill(robot, &own);
    if (CountTransitions(rollouts_) == 0)
      throw std::invalid_argument("there is no transition to calibrate with");
  }

  Findings Run() {
    const auto start = std::chrono::steady_clock::now();
    const GapFit fit = Fit();
    const MethodResult& result = fit.result;
    findings_.method = options_.method;
    findings_.used = result.used;
    findings_.seed = options_.seed;
    findings_.prior = PriorGaussian(robot_);
    findings_.posterior = result.posterior;
    findings_.samples = PhysicalColumns(robot_, result.samples);
    findings_.transitions = static_cast<int64_t>(CountTransitions(rollouts_));
    findings_.simulated_steps = result.simulated_steps;
    findings_.failures = result.failures;
    findings_.check = result.check;
    findings_.warnings = result.warnings;
    findings_.misspecification = fit.alarm;
    findings_.gap = fit.gap;
    findings_.diagnostic_steps = fit.simulated_steps;
    mean_ = Moments(result.posterior).mean;
    if (result.curriculum) findings_.stages = result.curriculum->stages;
    TakeOneStep(fit.view);
    FindWhatIsKnown(fit);
    CrossValidate(result);
    if (findings_.gap.residual) findings_.gap.summary += kCure;
    JudgeSubstep(fit);
    JudgeRows(fit.view);
    CompareLogs();
    if (!still_.empty()) findings_.warnings.push_back(StillWarning(still_));
    if (std::string contradiction = Contradiction(findings_, robot_); !contradiction.empty())
      findings_.warnings.insert(findings_.warnings.begin(), std::move(contradiction));
    findings_.seconds = SecondsSince(start);
    return std::move(findings_);
  }

 private:
  // What a method can learn from.
  std::vector<Rollout> Motion(const Log& log) const {
    std::vector<Rollout> rollouts = log.rollouts;
    if (KnowsLikelihood(options_.method))
      ForgetVelocities(robot_, UnreadJoints(robot_, log.differenced), &rollouts);
    return rollouts;
  }

  // With what the model lacks, if errors tell.
  GapFit Fit() const {
    const MethodInput input{model_, rollouts_, options_};
    MethodResult result = RunMethod(input);
    return CloseGap(input, std::move(result), NotJudged());
  }

  // At the mean that all transitions have informed, whatever method has found it.
  void TakeOneStep(const OneStepView& view) {
    findings_.noise_sd = view.noise_sd;
    findings_.discrepancy = MeanSquaredError(view);
    findings_.errors = view.fit.errors;
    findings_.rows = view.rows;
  }

  void FindWhatIsKnown(const GapFit& fit) {
    Identifiability& found = findings_.identifiability;
    found = FindIdentifiability(robot_, fit.information,
                                findings_.prior.covariance.diagonal().cwiseSqrt(),
                                Moments(findings_.posterior));
    found.summary += Doubt(fit.result.used, fit.result.ess, findings_.prior.mean.size());
    if (!informed()) found.summary = fmt::format("no parameter is determined: {}", kNotInformed);
    findings_.cramer_rao = findings_.identifiability.cramer_rao;
    ExcitationSettings settings;
    settings.seed = options_.seed;
    settings.seconds = std::min(settings.seconds, robot_.task.steps * robot_.task.period);
    findings_.advice =
        AdviseMotion(robot_, Moments(findings_.posterior), findings_.identifiability, settings)
            .summary;
  }

  // Why errors tell nothing of the model, empty if they do.
  std::string NotJudged() const {
    if (KnowsLikelihood(options_.method)) return {};
    for (const Log& log : logs_) {
      if (!log.differenced.empty())
        return "the model is not judged: " + DifferencesWarning(log.differenced);
    }
    return {};
  }

  bool informed() const { return findings_.gap.informed != Informed::kNone; }
  // The steps that the parameters are learnt from.
  std::vector<Rollout> Informing(std::span<const Rollout> rollouts) const {
    return InformingSteps(model_, mean_, rollouts, findings_.gap.informed);
  }

  // Fits again without a part of the data, which then judges.
  void CrossValidate(const MethodResult& result) {
    Split split = HoldOut(rollouts_);
    Discrepancy discrepancy(robot_, options_.execution);
    Eigen::VectorXd mean = mean_;
    if (!split.held_out.empty() && informed()) {
      CalibrationOptions again = options_;
      again.progress = [&](const std::string&, double share) {
        options_.progress("hold-out", share);
      };
      if (result.curriculum) again.method = "laplace";
      const std::vector<Rollout> fitted = Informing(split.fitted);
      try {
        const MethodResult part =
            RunMethod({model_, fitted, again, result.curriculum ? mean_ : Eigen::VectorXd()});
        mean = Moments(part.posterior).mean;
        findings_.diagnostic_steps += part.simulated_steps;
      } catch (const std::invalid_argument& error) {
        findings_.warnings.push_back(fmt::format("nothing could be held out: {}", error.what()));
        split = {rollouts_, {}};
      }
    }
    findings_.holdout = Judge(discrepancy, split, robot_.ToPhysical(mean),
                              robot_.ToPhysical(findings_.prior.mean), options_.replay);
    if (options_.replay) findings_.diagnostic_steps += 2 * findings_.holdout.held_out;
    for (const HorizonError& error : findings_.holdout.errors)
      findings_.diagnostic_steps += 2 * error.windows * error.horizon;
    if (!informed())
      findings_.holdout.summary =
          fmt::format("the posterior is the prior, and predicts as it does: {}", kNotInformed);
    if (findings_.gap.residual && !split.held_out.empty()) JudgeResidualOf(split, mean);
  }

  // Learns what the model lacks from the same part of the data, too.
  void JudgeResidualOf(const Split& split, const Eigen::VectorXd& mean) {
    ResidualFitOptions options;
    options.free = findings_.gap.residual->free.has_value();
    options.touching = findings_.gap.residual->touching.has_value();
    options.seed = options_.seed;
    const Residual residual = FitResidual(model_, mean, split.fitted, options).residual;
    if (!residual.any()) return;
    JudgeResidual(model_, residual, split, robot_.ToPhysical(mean), &findings_.holdout);
    const HorizonError& step = findings_.holdout.errors[0];
    if (step.corrected > kHarm * step.posterior)
      LeaveOut(
          "what was learnt of what it lacks predicts motion that it has not seen worse than the "
          "model alone, and is left out",
          &findings_.gap);
  }

  // Where the model explains the log the longest windows tell most; else single steps, of the fit
  // to all of it.
  void JudgeSubstep(const GapFit& fit) {
    if (!KnowsLikelihood(options_.method)) return;
    const bool explained = !fit.alarm.alarm && fit.result.curriculum;
    const std::optional<FinerSteps> finer =
        explained
            ? TryFinerSteps(model_, rollouts_, fit.result.curriculum->horizon,
                            fit.result.curriculum->noise_sd, mean_, options_.execution,
                            &findings_.diagnostic_steps)
            : TryFinerSteps(model_, rollouts_, ShortestWindow(rollouts_), fit.view.noise_sd,
                            fit.view.fit.mode, options_.execution, &findings_.diagnostic_steps);
    if (!finer) return;
    const std::string too_long = WhyTooLong(*finer, robot_, Moments(findings_.posterior));
    if (!too_long.empty()) findings_.warnings.push_back(too_long);
  }

  // A driver's log says when efforts acted. A table may have them in another row.
  void JudgeRows(const OneStepView& view) {
    if (!KnowsLikelihood(options_.method) || view.noise_known) return;
    findings_.efforts = FindEffortShift(model_, rollouts_, view.noise_sd, options_.execution,
                                        &findings_.diagnostic_steps);
    if (findings_.efforts.rows != 0)
      findings_.warnings.insert(findings_.warnings.begin(), DescribeShift(findings_.efforts));
  }

  // Each log on its own: are they of the same robot?
  void CompareLogs() {
    Agreement& agreement = findings_.agreement;
    if (logs_.size() < 2) {
      agreement.summary = "a single log: nothing to compare it with";
      return;
    }
    if (!informed()) {
      agreement.summary = fmt::format("the logs cannot be compared: {}", kNotInformed);
      return;
    }
    std::vector<LogFit> fits;
    for (size_t i = 0; i < logs_.size(); ++i) {
      const std::string& name = logs_[i].name;
      try {
        CurriculumOptions options;
        options.horizons = options_.horizons, options.execution = options_.execution,
        options.starts = 1;
        const CurriculumFit own = FitCurriculum(model_, Informing(own_[i]), options, mean_);
        findings_.diagnostic_steps += own.simulated_steps;
        fits.push_back({name, own.fit});
      } catch (const std::invalid_argument& error) {
        findings_.warnings.push_back(fmt::format("{} on its own: {}", name, error.what()));
      }
    }
    agreement = plumb::CompareLogs(robot_, findings_.prior, fits);
  }

  const RobotDescription& robot_;
  std::shared_ptr<const Model> model_;
  std::span<const Log> logs_;
  std::vector<std::vector<Rollout>> own_;  // of each log, as the method takes it
  const CalibrationOptions& options_;
  std::vector<Rollout> rollouts_;
  std::vector<std::string> still_;  // columns
  Eigen::VectorXd mean_;
  Findings findings_;
};

}  // namespace

Findings Calibrate(const RobotDescription& robot, std::span<const Log> logs,
                   const CalibrationOptions& options) {
  return Calibration(robot, logs, options).Run();
}

}  // namespace plumb
