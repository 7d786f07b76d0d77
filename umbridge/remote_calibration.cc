#include "umbridge/remote_calibration.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <vector>

#include "calibrator/diagnostics/identifiability.h"
#include "calibrator/diagnostics/model_test.h"
#include "calibrator/fit/estimated_noise.h"
#include "calibrator/fit/one_step.h"
#include "calibrator/fit/physical_columns.h"
#include "calibrator/fit/recorded_window.h"
#include "calibrator/fit/robot_least_squares.h"
#include "calibrator/fit/whitening.h"
#include "calibrator/fit/window_errors.h"
#include "calibrator/inference/laplace.h"
#include "calibrator/motion/differences.h"
#include "calibrator/motion/still_readings.h"
#include "calibrator/results/summary.h"
#include "common/time_units.h"
#include "robot/parameter_distribution.h"
#include "sim/model.h"
#include "umbridge/robot_models.h"

namespace plumb {
namespace {

constexpr int kNoiseRounds = 4;    // until the noise of beginnings and ends agrees
constexpr double kSettled = 0.05;  // of the noise's scale
constexpr Eigen::Index kSamples = 1000;

/// Errors of the model's next states, in the rows of WindowErrors.
class RemoteErrors {
 public:
  RemoteErrors(const RobotDescription& robot, const std::vector<Rollout>& rollouts,
               RemoteModel& model, const std::function<void(const std::string&, double)>& progress)
      : robot_(robot),
        rollouts_(rollouts),
        model_(model),
        progress_(progress),
        own_(std::make_shared<Model>(robot), rollouts, 1, ExecutionOptions()),
        steps_(std::make_shared<Model>(robot), rollouts, 1),
        noise_sd_(own_.noise_sd()) {
    RequireNumbers(robot);
    Eigen::Index first = 0;
    for (const Rollout& rollout : rollouts) {
      first_.push_back(first);
      first += static_cast<Eigen::Index>(rollout.transitions.size());
    }
  }

  LeastSquares Problem() {
    LeastSquares problem = ProblemOf(robot_, own_);
    problem.errors = [this](const Eigen::MatrixXd& coordinates) {
      Eigen::MatrixXd errors = Raw(coordinates);
      Whiten(&errors);
      return errors;
    };
    return problem;
  }

  /// Takes from our own simulator with these parameters how a step carries the noise of the state
  /// that it begins with along; where that fails, from free motion.
  void Linearise(const Eigen::VectorXd& coordinates) {
    const Eigen::VectorXd physical = robot_.ToPhysical(coordinates);
    const Eigen::MatrixXd starts = steps_.Starts(), ends = steps_.Predict(physical, starts);
    const Eigen::VectorXd differences = StartDifferences(noise_sd_);
    sensitivity_.assign(steps_.steps().size(), Eigen::MatrixXd(starts.rows(), starts.rows()));
    for (Eigen::Index c = 0; c < starts.rows(); ++c) {
      Eigen::MatrixXd moved = starts;
      moved.row(c).array() += differences(c);
      const Eigen::MatrixXd slopes = (steps_.Predict(physical, moved) - ends) / differences(c);
      for (size_t i = 0; i < sensitivity_.size(); ++i)
        sensitivity_[i].col(c) = slopes.col(static_cast<Eigen::Index>(i));
    }
    for (size_t i = 0; i < sensitivity_.size(); ++i) {
      if (!sensitivity_[i].allFinite())
        sensitivity_[i] = FreeMotion(own_.num_velocities(), steps_.steps()[i].recorded->duration());
    }
  }

  bool noise_known() const { return own_.noise_known(); }
  const std::vector<WindowErrors::Row>& rows() const { return own_.rows(); }
  void Scale(const LaplaceFit& fit) { noise_sd_ = ScaledNoise(noise_sd_, fit); }
  /// What is left of a fit, with the noise by its errors.
  OneStepView View(const LaplaceFit& fit) {
    own_.set_noise_sd(noise_sd_);
    OneStepView view;
    view.fit = fit, view.rows = rows(), view.noise_known = noise_known();
    view.noise_sd = EstimatedNoise(own_, fit);
    return view;
  }
  int64_t evaluations() const { return evaluations_; }

 private:
  const Transition& TransitionOf(const WindowErrors::Row& row) const {
    return rollouts_[static_cast<size_t>(row.rollout)]
        .transitions[static_cast<size_t>(row.transition)];
  }

  // Among the transitions of all roll-outs.
  Eigen::Index IndexOf(const WindowErrors::Row& row) const {
    return first_[static_cast<size_t>(row.rollout)] + row.transition;
  }

  Eigen::MatrixXd Raw(const Eigen::MatrixXd& coordinates) {
    const Eigen::Index size = Eigen::Index{2} * own_.num_velocities();
    Eigen::MatrixXd errors(static_cast<Eigen::Index>(rows().size()), coordinates.cols());
    for (Eigen::Index j = 0; j < coordinates.cols(); ++j) {
      progress_(fmt::format("{} evaluations of {}", ++evaluations_, model_.name()), 0.5);
      const Eigen::VectorXd next = model_.Evaluate(robot_.ToPhysical(coordinates.col(j)));
      for (size_t i = 0; i < rows().size(); ++i) {
        const WindowErrors::Row& row = rows()[i];
        const Transition& t = TransitionOf(row);
        const Eigen::Index c = row.coordinate, n = own_.num_velocities();
        errors(static_cast<Eigen::Index>(i), j) =
            next(size * IndexOf(row) + c) - (c < n ? t.next_q(c) : t.next_v(c - n));
      }
      if (!errors.col(j).allFinite()) errors.col(j).setConstant(NAN);
    }
    return errors;
  }

  void Whiten(Eigen::MatrixXd* errors) const {
    for (size_t begin = 0, end = 0; begin < rows().size(); begin = end) {
      const Transition& t = TransitionOf(rows()[begin]);
      const Eigen::MatrixXd& slopes = sensitivity_[static_cast<size_t>(IndexOf(rows()[begin]))];
      std::vector<Eigen::Index> coordinates;
      for (; end < rows().size() && rows()[end].window == rows()[begin].window; ++end)
        coordinates.push_back(rows()[end].coordinate);
      const auto count = static_cast<Eigen::Index>(end - begin);
      Eigen::VectorXd end_sd(count);
      for (Eigen::Index i = 0; i < count; ++i) {
        end_sd(i) = EndSd(t, coordinates[static_cast<size_t>(i)], noise_sd_);
      }
      WhitenWindow(std::vector<Eigen::Index>{0, count}, StartSd(t, noise_sd_),
                   slopes(coordinates, Eigen::all), end_sd,
                   errors->middleRows(static_cast<Eigen::Index>(begin), count));
    }
  }

  const RobotDescription& robot_;
  const std::vector<Rollout>& rollouts_;
  RemoteModel& model_;
  const std::function<void(const std::string&, double)>& progress_;
  WindowErrors own_;  // its rows, and nothing that it simulates
  OneStep steps_;
  std::vector<Eigen::MatrixXd> sensitivity_;  // of each transition
  std::vector<Eigen::Index> first_;           // transition of each roll-out
  Eigen::VectorXd noise_sd_;
  int64_t evaluations_ = 0;
};

LaplaceFit Fit(RemoteErrors& errors, const Prior& prior, const RemoteModel& model) {
  Eigen::VectorXd mode = prior.FromStandard(Eigen::VectorXd::Zero(prior.size()));
  for (int round = 1;; ++round) {
    LaplaceFit fit;
    errors.Linearise(mode);
    try {
      fit = FitLaplace(errors.Problem(), mode);
    } catch (const std::invalid_argument& error) {
      const std::string& theirs = model.last_error();
      throw std::invalid_argument(model.name() + ": " + error.what() +
                                  (theirs.empty() ? "" : "; it has said: " + theirs));
    }
    mode = fit.mode;
    const bool settled = errors.noise_known() || (fit.scale.array().log().abs() < kSettled).all();
    if (settled || round == kNoiseRounds) return fit;
    errors.Scale(fit);
  }
}

}  // namespace

Eigen::Index NextStatesSize(const RobotDescription& robot, std::span<const Log> logs) {
  size_t transitions = 0;
  for (const Log& log : logs) transitions += CountTransitions(log.rollouts);
  return Eigen::Index{2} * robot.num_velocities() * static_cast<Eigen::Index>(transitions);
}

Findings CalibrateRemote(const RobotDescription& robot, std::span<const Log> logs,
                         RemoteModel& model, const CalibrationOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  RequireVelocities(robot, logs, "a model of somebody else's");
  std::vector<Rollout> rollouts = RolloutsOf(logs);
  const std::vector<std::string> still = ForgetStill(robot, &rollouts);
  const Prior prior = PriorOf(robot);
  RemoteErrors errors(robot, rollouts, model, options.progress);
  const LaplaceFit fit = Fit(errors, prior, model);

  Findings findings;
  findings.method = options.method, findings.used = "laplace", findings.seed = options.seed;
  findings.prior = PriorGaussian(robot);
  findings.posterior = {{1}, {fit.posterior}};
  Random random(options.seed);
  const Eigen::MatrixXd samples = Draw(fit, prior, kSamples, random);
  findings.samples = PhysicalColumns(robot, samples);
  findings.transitions = static_cast<int64_t>(CountTransitions(rollouts));
  findings.simulated_steps = errors.evaluations() * findings.transitions;
  const OneStepView view = errors.View(fit);
  findings.noise_sd = view.noise_sd;
  findings.errors = view.fit.errors, findings.rows = view.rows;
  findings.discrepancy = MeanSquaredError(view);
  findings.identifiability = FindIdentifiability(
      robot, fit.information, findings.prior.covariance.diagonal().cwiseSqrt(), fit.posterior);
  findings.cramer_rao = findings.identifiability.cramer_rao;
  findings.misspecification.judged = false;
  findings.misspecification.summary = "not judged: the model is not ours";
  findings.holdout.summary = "nothing was held out: the model is not ours";
  findings.agreement.summary = "the logs were not compared: the model is not ours";
  if (!still.empty()) findings.warnings.push_back(StillWarning(still));
  if (std::string contradiction = Contradiction(findings, robot); !contradiction.empty())
    findings.warnings.push_back(std::move(contradiction));
  findings.seconds = SecondsSince(start);
  return findings;
}

}  // namespace plumb
