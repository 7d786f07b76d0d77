#include "calibrator/diagnostics/model_test.h"

#include <fmt/format.h>

#include <cmath>
#include <vector>

#include "calibrator/diagnostics/candidates.h"
#include "calibrator/diagnostics/projected_errors.h"
#include "calibrator/diagnostics/witnesses.h"
#include "calibrator/fit/curriculum.h"
#include "calibrator/fit/estimated_noise.h"
#include "calibrator/fit/one_step.h"
#include "calibrator/fit/physical_columns.h"
#include "calibrator/fit/recorded_window.h"
#include "calibrator/fit/robot_least_squares.h"
#include "calibrator/inference/displaced.h"
#include "calibrator/inference/slopes.h"
#include "common/decompositions.h"
#include "common/special_numbers.h"
#include "robot/parameter_distribution.h"
#include "sim/tasks/task.h"

namespace plumb {
namespace {

constexpr int kNoiseRounds = 3;  // until witnesses and their noise agree
constexpr double kLargest = 5;   // [sd] that an error counts as, for the noise

class Test {
 public:
  Test(const TestedFit& fit, ExecutionOptions execution)
      : fit_(fit),
        robot_(fit.model->description()),
        mean_(Moments(fit.posterior).mean),
        physical_(robot_.ToPhysical(mean_)),
        candidates_(FindCandidates(robot_)),
        extended_(std::make_shared<Model>(WithCandidates(robot_, candidates_))),
        errors_(extended_, fit.rollouts, ShortestWindow(fit.rollouts), execution),
        step_(extended_, fit.rollouts, execution.threads) {
    errors_.set_noise_sd(fit.noise_sd);
    nominal_ = extended_->parameters().means();
    nominal_.head(physical_.size()) = physical_;
  }

  ModelTest Run() {
    const FitResiduals residuals = OfAll();
    Misspecification all = FindMisspecification(Known(), residuals);
    if (ShortestWindow(fit_.rollouts) > 1) return {WithoutWitnesses(all), Consider(residuals, all)};
    if (!all.alarm || errors_.starts_known()) return {all, Consider(residuals, all)};
    Misspecification found = AskWitnesses();
    // Where nobody can tell, what all errors say may be so.
    GaussianMixture considered = Consider(residuals, found.judged ? found : all);
    return {std::move(found), std::move(considered)};
  }

  int64_t simulated_steps() const { return errors_.simulated_steps() + step_.simulated_steps(); }

 private:
  FitResiduals OfAll() {
    errors_.Linearise(nominal_);
    FitResiduals residuals = Residuals(fit_.rows);
    residuals.errors = fit_.one_step.errors;
    residuals.jacobian = fit_.one_step.jacobian;
    residuals.columns = CandidateColumns(
        [&](const Eigen::MatrixXd& x) { return errors_.Whitened(x); }, physical_, candidates_);
    // Whitened with the noise as estimated, or as known; then by what the errors' scale makes of
    // it, as the errors are.
    if (fit_.noise_known) DivideByScale(fit_.rows, &residuals.columns);
    return residuals;
  }

  // With what the parameters would change by, if each of the candidates changed.
  GaussianMixture Consider(const FitResiduals& residuals, const Misspecification& found) const {
    double best = 0;
    for (const CandidateChange& change : found.changes) best = std::max(best, change.gain);
    if (best == 0) return fit_.posterior;
    const Gaussian prior = PriorGaussian(robot_);
    const Eigen::VectorXd squares =
        ProjectedErrors(Known(), residuals).weight.cwiseAbs2();  // outliers count less
    const Eigen::MatrixXd weighted = squares.asDiagonal() * residuals.jacobian;
    const Eigen::MatrixXd covariance =
        Inverse(weighted.transpose() * residuals.jacobian + Inverse(prior.covariance));
    Eigen::MatrixXd moved(prior.mean.size(), static_cast<Eigen::Index>(found.changes.size()));
    Eigen::Index column = 0;
    for (const CandidateChange& change : found.changes) {
      moved.col(column++) = covariance *
                            (weighted.transpose() *
                             residuals.columns.col(static_cast<Eigen::Index>(change.candidate))) *
                            change.change * std::sqrt(change.gain / best);
    }
    GaussianMixture considered = fit_.posterior;
    for (Gaussian& component : considered.components)
      component = Displaced(prior, component, moved);
    return considered;
  }

  // Errors of windows depend on their own readings, and where motion is not linear over the noise
  // they are larger than whitened ones should be: an alarm may be either. Of what is wrong with
  // velocities alone they say little.
  static Misspecification WithoutWitnesses(const Misspecification& all) {
    Misspecification found;
    found.judged = false;
    found.summary =
        all.alarm ? "nobody can tell whether the model explains this log: nobody has read its "
                    "velocities, and errors of windows may depend on their own noise; if they do "
                    "not, " +
                        all.summary
                  : all.summary + ", as far as positions tell: nobody has read the velocities";
    return found;
  }

  Misspecification AskWitnesses() {
    const Eigen::MatrixXd raw = errors_.Raw(nominal_);
    Eigen::VectorXd noise_sd = fit_.noise_sd;
    Witnesses witnesses(step_, fit_.rows, nominal_, noise_sd);
    // What has made other errors larger has made the noise seem larger.
    for (int round = 1; round < kNoiseRounds && !fit_.noise_known; ++round) {
      if (witnesses.count() < kFewestWitnesses) break;
      noise_sd.array() *= ScaleOf(witnesses.rows(), witnesses.Whiten(raw));
      witnesses = Witnesses(step_, fit_.rows, nominal_, noise_sd);
    }
    const std::string share = fmt::format(
        "{} of {} transitions, as predictions of the others are not linear over the "
        "noise of the states that they begin with",
        witnesses.count(), step_.steps().size());
    Misspecification found;
    if (witnesses.count() < kFewestWitnesses) {
      found.judged = false;
      found.summary = "nobody can tell whether the model explains this log: only " + share;
      return found;
    }
    FitResiduals residuals = Residuals(witnesses.rows());
    residuals.errors = witnesses.Whiten(raw);
    residuals.jacobian = witnesses.Whiten(RawSlopes(raw));
    // What a candidate would change is asked where the reading before leads to. The reading itself
    // shares its noise with the error: where it says that a foot is deep in the ground the foot is
    // less so, the ground pushes less than predicted, and a right stiffness would look too large.
    const Eigen::MatrixXd starts = PredictStarts(step_, nominal_);
    residuals.columns = CandidateColumns(
        [&](const Eigen::MatrixXd& x) {
          return witnesses.Whiten(PredictRows(step_, fit_.rows, x, starts));
        },
        physical_, candidates_);
    if (fit_.noise_known) {
      Eigen::MatrixXd errors = residuals.errors;
      DivideByScale(residuals.rows, &errors);
      residuals.errors = errors;
      DivideByScale(residuals.rows, &residuals.jacobian);
      DivideByScale(residuals.rows, &residuals.columns);
    }
    residuals.where = FindWhereabouts(step_, witnesses.rows(), nominal_, starts);
    found = FindMisspecification(Known(), residuals);
    found.summary += "; judged by " + share;
    return found;
  }

  FitResiduals Residuals(std::span<const WindowErrors::Row> rows) const {
    return {fit_.rollouts,
            rows,
            {},
            {},
            std::vector<bool>(static_cast<size_t>(fit_.noise_sd.size()), fit_.noise_known),
            candidates_,
            {}};
  }

  RobotDescription Known() const { return fit_.model->Describe(physical_); }

  void DivideByScale(std::span<const WindowErrors::Row> rows, Eigen::MatrixXd* of_rows) const {
    for (size_t i = 0; i < rows.size(); ++i)
      of_rows->row(static_cast<Eigen::Index>(i)) /= fit_.one_step.scale(rows[i].coordinate);
  }

  // Root mean square of each entry's errors, 1 where there are hardly any.
  Eigen::ArrayXd ScaleOf(std::span<const WindowErrors::Row> rows,
                         const Eigen::VectorXd& errors) const {
    Eigen::ArrayXd squares = Eigen::ArrayXd::Zero(fit_.noise_sd.size()), count = squares;
    for (size_t i = 0; i < rows.size(); ++i) {
      const double error = std::min(kLargest, std::abs(errors(static_cast<Eigen::Index>(i))));
      squares(rows[i].coordinate) += error * error;
      count(rows[i].coordinate) += 1;
    }
    return (count >= kFewestWitnesses).select((squares / count.max(1)).sqrt(), 1.0);
  }

  // Of raw errors to the parameters, in units of the prior's standard deviations.
  Eigen::MatrixXd RawSlopes(const Eigen::VectorXd& at_mean) {
    const Eigen::VectorXd sd = PriorGaussian(robot_).covariance.diagonal().cwiseSqrt();
    const auto errors = [&](const Eigen::MatrixXd& from_mean) {
      Eigen::MatrixXd at = nominal_.replicate(1, from_mean.cols());
      at.topRows(physical_.size()) =
          PhysicalColumns(robot_, (sd.asDiagonal() * from_mean).colwise() + mean_);
      return errors_.Raw(at);
    };
    return Slopes(errors, Eigen::VectorXd::Zero(mean_.size()), at_mean,
                  ProblemOf(robot_, errors_).block);
  }

  const TestedFit& fit_;
  const RobotDescription& robot_;
  Eigen::VectorXd mean_, physical_, nominal_;  // of the posterior's mean
  std::vector<Candidate> candidates_;
  std::shared_ptr<const Model> extended_;
  WindowErrors errors_;
  OneStep step_;
};

}  // namespace

ModelTest TestModel(const TestedFit& fit, ExecutionOptions execution, int64_t* simulated_steps) {
  const Eigen::VectorXd units = MakeTask(fit.model->description())->state_scale();
  if (LeavesRounding(fit.noise_sd, units, fit.rows, fit.one_step.errors)) {
    ModelTest none{{}, fit.posterior};
    none.found.summary = "the model reproduces this log to five digits";
    return none;
  }
  Test test(fit, execution);
  ModelTest tested = test.Run();
  *simulated_steps += test.simulated_steps();
  return tested;
}

// The fit's errors are divided by a scale that was estimated of them: that is undone.
double MeanSquaredError(const OneStepView& view) {
  if (!view.noise_known) return kNaN;
  double squares = 0;
  for (Eigen::Index i = 0; i < view.fit.errors.size(); ++i) {
    const int coordinate = view.rows[static_cast<size_t>(i)].coordinate;
    squares += std::pow(view.fit.errors(i) * view.fit.scale(coordinate), 2);
  }
  return squares / static_cast<double>(view.fit.errors.size());
}

OneStepView ViewOneStep(const MethodInput& input, const MethodResult& result) {
  OneStepView view;
  if (result.curriculum) {
    view.fit = result.curriculum->one_step;
    view.rows = result.curriculum->rows;
    view.noise_sd = result.noise_sd;
    view.noise_known = result.curriculum->noise_known;
    view.information = result.curriculum->fit.information;
    return view;
  }
  const RobotDescription& robot = input.model->description();
  const Eigen::VectorXd mean = Moments(result.posterior).mean;
  WindowErrors errors(input.model, input.rollouts, ShortestWindow(input.rollouts),
                      input.options.execution);
  LaplaceOptions curvature_only;
  curvature_only.max_iterations = 0;
  errors.Linearise(robot.ToPhysical(mean));
  view.fit = FitLaplace(ProblemOf(robot, errors), mean, curvature_only);
  view.rows = errors.rows();
  view.noise_sd = errors.EndNoise();
  // there is none of what was never observed
  view.noise_sd.head(view.fit.scale.size()).array() *= view.fit.scale.array();
  view.noise_known = errors.noise_known();
  view.information = view.fit.information;
  view.simulated_steps = errors.simulated_steps();
  return view;
}

ModelTest TestModel(const MethodInput& input, const MethodResult& result, const OneStepView& view,
                    int64_t* simulated_steps) {
  return TestModel({input.model, input.rollouts, result.posterior, view.fit, view.rows,
                    view.noise_sd, view.noise_known},
                   input.options.execution, simulated_steps);
}

}  // namespace plumb
