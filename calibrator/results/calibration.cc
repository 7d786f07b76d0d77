#include "calibrator/results/calibration.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "calibrator/design/excitation.h"
#include "calibrator/diagnostics/holdout.h"
#include "calibrator/fit/likelihood_methods.h"
#include "calibrator/fit/methods.h"
#include "calibrator/fit/physical_columns.h"
#include "calibrator/gap/gap.h"
#include "calibrator/inference/chi_squared.h"
#include "calibrator/motion/differences.h"
#include "common/decompositions.h"
#include "common/time_units.h"
#include "robot/parameter_distribution.h"

namespace plumb {
namespace {

// p below which logs are of different robots, or the model is wrong
constexpr double kDisagreement = 1e-3;
constexpr char kCure[] =
    "; train on posterior and residual together (plumb train --distribution), and, as a residual "
    "is right only near what it was learnt from, record the trained policy's motion and calibrate "
    "with all logs";

class Calibration {
 public:
  Calibration(const RobotDescription& robot, std::span<const Log> logs,
              const CalibrationOptions& options)
      : robot_(robot), model_(std::make_shared<Model>(robot)), logs_(logs), options_(options) {
    for (const Log& log : logs) own_.push_back(Motion(log));
    for (const std::vector<Rollout>& own : own_)
      rollouts_.insert(rollouts_.end(), own.begin(), own.end());
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
    if (fit.gap.residual) findings_.gap.summary += kCure;
    findings_.diagnostic_steps = fit.simulated_steps;
    mean_ = Moments(result.posterior).mean;
    if (result.curriculum) findings_.stages = result.curriculum->stages;
    TakeOneStep(fit.view);
    FindWhatIsKnown(fit.information);
    CrossValidate(result);
    CompareLogs();
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

  // The fit's errors are divided by a scale that was estimated of them: that is undone.
  static double MeanSquaredError(const OneStepView& view) {
    if (!view.noise_known) return std::numeric_limits<double>::quiet_NaN();
    double squares = 0;
    for (Eigen::Index i = 0; i < view.fit.errors.size(); ++i) {
      const int coordinate = view.rows[static_cast<size_t>(i)].coordinate;
      squares += std::pow(view.fit.errors(i) * view.fit.scale(coordinate), 2);
    }
    return squares / static_cast<double>(view.fit.errors.size());
  }

  void FindWhatIsKnown(const Eigen::MatrixXd& information) {
    findings_.identifiability =
        FindIdentifiability(robot_, information, prior_sd(), Moments(findings_.posterior));
    if (!informed())
      findings_.identifiability.summary =
          fmt::format("no parameter is determined: {}", kNotInformed);
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
    if (residual.any())
      JudgeResidual(model_, residual, split, robot_.ToPhysical(mean), &findings_.holdout);
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
    std::vector<LaplaceFit> fits;
    std::vector<std::string> names;
    for (size_t i = 0; i < logs_.size(); ++i) {
      const Log& log = logs_[i];
      try {
        CurriculumOptions options;
        options.horizons = options_.horizons, options.execution = options_.execution,
        options.starts = 1;
        const CurriculumFit own = FitCurriculum(model_, Informing(own_[i]), options, mean_);
        findings_.diagnostic_steps += own.simulated_steps;
        fits.push_back(own.fit);
        names.push_back(log.name);
      } catch (const std::invalid_argument& error) {
        findings_.warnings.push_back(fmt::format("{} on its own: {}", log.name, error.what()));
      }
    }
    for (size_t i = 0; i < fits.size(); ++i) agreement.logs.push_back(Against(names[i], fits, i));
    if (fits.size() < 2) {
      agreement.summary =
          "fewer than two of the logs can be fitted on their own: nothing to compare";
      return;
    }
    std::string against;
    for (const LogAgreement& log : agreement.logs) {
      if (log.p >= kDisagreement) continue;
      agreement.agree = false;
      against +=
          fmt::format("{}{} ({:.1f} sd)", against.empty() ? "" : ", ", log.log, log.distance);
    }
    agreement.summary = agreement.agree
                            ? fmt::format("the {} logs agree", agreement.logs.size())
                            : "the logs do not agree with each other: " + against +
                                  "; they are of different robots, or the model is wrong "
                                  "in a way that depends on the motion";
  }

  // A log's likelihood against that of the others together, both quadratic: their modes differ by a
  // normal vector with the sum of both covariances, in the directions that both determine.
  LogAgreement Against(const std::string& name, const std::vector<LaplaceFit>& fits,
                       size_t i) const {
    const Eigen::Index n = findings_.prior.mean.size();
    const LaplaceFit& own = fits[i];
    Eigen::MatrixXd information = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd weighted = Eigen::VectorXd::Zero(n);
    for (size_t k = 0; k < fits.size(); ++k) {
      if (k == i) continue;
      information += Data(fits[k]);
      weighted += Data(fits[k]) * LikelihoodMode(fits[k]);
    }
    const Eigen::VectorXd sd = prior_sd();
    const auto scaled = [&](const Eigen::MatrixXd& m) -> Eigen::MatrixXd {
      return sd.asDiagonal() * m * sd.asDiagonal();
    };
    // Pseudo-inverses in the prior's units: directions with less information than the prior has do
    // not count.
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> mine(scaled(Data(own))),
        theirs(scaled(information));
    const auto pseudo =
        [](const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>& eigen) -> Eigen::MatrixXd {
      const Eigen::ArrayXd values = eigen.eigenvalues().array();
      const Eigen::VectorXd inverse = (values > 1).select(1 / values.max(1e-300), 0.0);
      return eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose();
    };
    const Eigen::VectorXd their_mode =
        sd.asDiagonal() * pseudo(theirs) * sd.asDiagonal() * weighted;
    Eigen::MatrixXd both(n, 0);
    const Eigen::MatrixXd my_projector = Projector(mine), their_projector = Projector(theirs);
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> common(
        Eigen::MatrixXd(my_projector * their_projector * my_projector));
    const Eigen::Index rank = (common.eigenvalues().array() > 0.99).count();
    both = common.eigenvectors().rightCols(rank);
    LogAgreement result;
    result.log = name;
    result.mean = robot_.ToPhysical(own.mode);
    const Eigen::VectorXd own_sd = own.posterior.covariance.diagonal().cwiseSqrt();
    result.sd =
        (robot_.ToPhysical(own.mode + own_sd) - robot_.ToPhysical(own.mode - own_sd)).cwiseAbs() /
        2;
    if (rank == 0) {
      result.distance = 0, result.p = 1;
      return result;
    }
    const Eigen::VectorXd offset =
        both.transpose() * ((LikelihoodMode(own) - their_mode).cwiseQuotient(sd));
    const Eigen::MatrixXd spread = both.transpose() * (pseudo(mine) + pseudo(theirs)) * both;
    const double squared = offset.dot(spread.llt().solve(offset));
    result.distance = std::sqrt(squared);
    result.p = std::min(
        1.0, ChiSquaredTail(static_cast<double>(rank), squared) * static_cast<double>(fits.size()));
    return result;
  }

  Eigen::VectorXd prior_sd() const { return findings_.prior.covariance.diagonal().cwiseSqrt(); }
  static Eigen::MatrixXd Projector(const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>& eigen) {
    const Eigen::Index rank = (eigen.eigenvalues().array() > 1).count();
    const auto v = eigen.eigenvectors().rightCols(rank);
    return v * v.transpose();
  }
  // The likelihood alone: the posterior without the prior.
  Eigen::MatrixXd Data(const LaplaceFit& fit) const {
    return Precision(fit.posterior) -
           Eigen::MatrixXd(findings_.prior.covariance.diagonal().cwiseInverse().asDiagonal());
  }
  // Data * mode + prior * prior mean = posterior precision * posterior mode.
  Eigen::VectorXd LikelihoodMode(const LaplaceFit& fit) const {
    const Eigen::VectorXd sd = prior_sd();
    const Eigen::VectorXd right =
        Precision(fit.posterior) * fit.mode - findings_.prior.mean.cwiseQuotient(sd.cwiseAbs2());
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(
        Eigen::MatrixXd(sd.asDiagonal() * Data(fit) * sd.asDiagonal()));
    const Eigen::ArrayXd values = eigen.eigenvalues().array();
    // as in Against
    const Eigen::VectorXd inverse = (values > 1).select(1 / values.max(1e-300), 0.0);
    return sd.asDiagonal() *
           (eigen.eigenvectors() * inverse.asDiagonal() * eigen.eigenvectors().transpose()) *
           sd.asDiagonal() * right;
  }

  const RobotDescription& robot_;
  std::shared_ptr<const Model> model_;
  std::span<const Log> logs_;
  std::vector<std::vector<Rollout>> own_;  // of each log, as the method takes it
  const CalibrationOptions& options_;
  std::vector<Rollout> rollouts_;
  Eigen::VectorXd mean_;
  Findings findings_;
};

}  // namespace

Findings Calibrate(const RobotDescription& robot, std::span<const Log> logs,
                   const CalibrationOptions& options) {
  return Calibration(robot, logs, options).Run();
}

}  // namespace plumb
