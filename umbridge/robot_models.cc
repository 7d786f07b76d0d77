#include "umbridge/robot_models.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "calibrator/fit/curriculum.h"
#include "calibrator/fit/one_step.h"
#include "calibrator/fit/robot_least_squares.h"
#include "calibrator/fit/window_errors.h"
#include "calibrator/inference/laplace.h"
#include "calibrator/inference/slopes.h"
#include "calibrator/motion/differences.h"
#include "calibrator/motion/still_readings.h"
#include "sim/model.h"

namespace plumb {
namespace {

CurriculumFit FirstFit(const std::shared_ptr<const Model>& model, std::span<const Rollout> rollouts,
                       ExecutionOptions execution) {
  CurriculumOptions options;
  options.horizons = {1};
  options.execution = execution;
  return FitCurriculum(model, rollouts, options);
}

std::vector<Rollout> ReadMotion(const RobotDescription& robot, std::span<const Log> logs) {
  RequireVelocities(robot, logs, "a model that is served");
  std::vector<Rollout> rollouts = RolloutsOf(logs);
  ForgetStill(robot, &rollouts);
  return rollouts;
}

}  // namespace

struct RobotModels::Parts {
  Parts(const RobotDescription& robot, std::span<const Log> logs, ExecutionOptions execution)
      : model(std::make_shared<Model>(robot)),
        rollouts(ReadMotion(robot, logs)),
        first(FirstFit(model, rollouts, execution)),
        errors(model, rollouts, 1, execution),
        steps(model, rollouts, execution.threads),
        starts(steps.Starts()),
        physics(model->parameters().Nominal()),
        problem(ProblemOf(model->description(), errors)) {
    errors.set_noise_sd(first.noise_sd);
    errors.Linearise(robot.ToPhysical(first.fit.mode));
    problem.errors = [this](const Eigen::MatrixXd& physical) { return errors.Whitened(physical); };
  }

  /// @throws std::invalid_argument naming the parameter.
  void RequirePhysical(const Eigen::MatrixXd& parameters) {
    for (const auto& column : parameters.colwise()) model->parameters().Apply(column, &physics);
  }

  bool IsPhysical(const Eigen::VectorXd& parameters) {
    try {
      RequirePhysical(parameters);
      return true;
    } catch (const std::invalid_argument&) {
      return false;
    }
  }

  Eigen::MatrixXd Likelihood(const Eigen::MatrixXd& parameters) {
    Eigen::MatrixXd likelihood(1, parameters.cols());
    for (Eigen::Index j = 0; j < parameters.cols(); ++j) {
      const Eigen::VectorXd column = parameters.col(j);
      const double value =
          IsPhysical(column) ? LogLikelihood(problem, column, first.one_step.degrees_of_freedom)(0)
                             : kImpossible;
      likelihood(0, j) = std::max(value, kImpossible);
    }
    return likelihood;
  }

  Eigen::MatrixXd NextStates(const Eigen::MatrixXd& parameters) {
    RequirePhysical(parameters);
    Eigen::MatrixXd states(starts.size(), parameters.cols());
    for (Eigen::Index j = 0; j < parameters.cols(); ++j)
      states.col(j) = steps.Predict(parameters.col(j), starts).reshaped();
    return states;
  }

  std::shared_ptr<const Model> model;
  std::vector<Rollout> rollouts;
  CurriculumFit first;
  WindowErrors errors;
  OneStep steps;
  Eigen::MatrixXd starts;
  Physics<double> physics;
  LeastSquares problem;
};

void RequireNumbers(const RobotDescription& robot) {
  if (robot.num_positions() != robot.num_velocities())
    throw std::invalid_argument(robot.name +
                                " has a spherical joint, whose orientation is no list of numbers "
                                "to learn from: next states have none");
}

RobotModels::RobotModels(const RobotDescription& robot, std::span<const Log> logs,
                         ExecutionOptions execution) {
  if (robot.parameters.empty())
    throw std::invalid_argument(robot.name + " has no uncertain parameters: there is no model");
  RequireNumbers(robot);
  parts_ = std::make_unique<Parts>(robot, logs, execution);
}

RobotModels::~RobotModels() = default;

std::vector<ServedModel> RobotModels::Models() {
  Parts& parts = *parts_;
  const RobotDescription& robot = parts.model->description();
  const auto n = static_cast<Eigen::Index>(robot.parameters.size());
  Eigen::VectorXd differences(n);
  for (Eigen::Index i = 0; i < n; ++i)
    differences(i) =
        kSlopeDifference * std::sqrt(robot.parameters[static_cast<size_t>(i)].variance);
  return {
      {"log_likelihood", n, 1,
       [&parts](const Eigen::MatrixXd& parameters) { return parts.Likelihood(parameters); },
       differences},
      {"errors", n, static_cast<Eigen::Index>(parts.errors.rows().size()),
       [&parts](const Eigen::MatrixXd& parameters) -> Eigen::MatrixXd {
         parts.RequirePhysical(parameters);
         return parts.errors.Whitened(parameters);
       },
       differences},
      {"next_states", n, parts.starts.size(),
       [&parts](const Eigen::MatrixXd& parameters) { return parts.NextStates(parameters); },
       differences},
  };
}

}  // namespace plumb
