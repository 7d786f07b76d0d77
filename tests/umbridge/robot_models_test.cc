// The functions that are served of a robot's log, against the simulator and the fit.
#include "umbridge/robot_models.h"

#include <catch2/catch.hpp>
#include <cstdlib>

#include "calibrator/fit/curriculum.h"
#include "common/decompositions.h"
#include "common/random.h"
#include "sim/simulator.h"

namespace plumb {
namespace {

using Eigen::VectorXd;

constexpr int kSteps = 200;
constexpr double kNoise = 1e-3;

/// A cart-pole whose only unknowns are its masses.
RobotDescription Cartpole() {
  RobotDescription robot =
      LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/cartpole");
  std::erase_if(robot.parameters, [](const auto& p) { return !p.name.starts_with("mass/"); });
  robot.virtual_robot.hidden.clear();
  return robot;
}

/// Under random efforts, with noise on every reading if `sd` is not 0.
Log Move(const RobotDescription& robot, const VectorXd& truth, double sd) {
  Simulator simulator(robot);
  simulator.SetParameters(truth);
  Random random(3);
  Log log;
  log.rollouts.resize(1);
  const auto read = [&](const VectorXd& x) {
    VectorXd reading = x;
    for (double& entry : reading) entry += sd * random.Normal();
    return reading;
  };
  VectorXd q = read(simulator.q()), v = read(simulator.v());
  const VectorXd sds = VectorXd::Constant(q.size(), sd);
  for (int step = 0; step < kSteps; ++step) {
    VectorXd effort = VectorXd::Zero(robot.num_velocities());
    effort(0) = random.Uniform(-5, 5);
    const std::vector<EffortSegment> efforts{{robot.task.period, effort}};
    simulator.Step(efforts);
    const VectorXd next_q = read(simulator.q()), next_v = read(simulator.v());
    log.rollouts[0].transitions.push_back(
        {step, q, v, next_q, next_v, sds, sds, sds, sds, efforts});
    q = next_q, v = next_v;
  }
  return log;
}

const ServedModel& Named(const std::vector<ServedModel>& models, const std::string& name) {
  for (const ServedModel& model : models) {
    if (model.name == name) return model;
  }
  FAIL(name);
  throw;
}

}  // namespace

TEST_CASE("served models: the right parameters predict the recorded states") {
  const RobotDescription robot = Cartpole();
  const VectorXd truth = 1.1 * Model(robot).parameters().means();
  const std::vector<Log> logs{Move(robot, truth, 0)};
  RobotModels served(robot, logs, ExecutionOptions(1));
  const std::vector<ServedModel> models = served.Models();
  const ServedModel& next = Named(models, "next_states");
  REQUIRE(next.inputs == 2);
  REQUIRE(next.outputs == 4 * kSteps);
  Eigen::MatrixXd both(2, 2);
  both << truth, 1.2 * truth;
  const Eigen::MatrixXd states = next.evaluate(both);
  for (int step = 0; step < kSteps; ++step) {
    const Transition& t = logs[0].rollouts[0].transitions[static_cast<size_t>(step)];
    CHECK((states.col(0).segment(4 * step, 2) - t.next_q).norm() < 1e-12);
    CHECK((states.col(0).segment(4 * step + 2, 2) - t.next_v).norm() < 1e-12);
  }
  CHECK((states.col(1) - states.col(0)).norm() > 0.1);
}

TEST_CASE("served models: errors are noise at the truth, where the likelihood is highest") {
  const RobotDescription robot = Cartpole();
  const VectorXd truth = 1.1 * Model(robot).parameters().means();
  const std::vector<Log> logs{Move(robot, truth, kNoise)};
  RobotModels served(robot, logs, ExecutionOptions(1));
  const std::vector<ServedModel> models = served.Models();

  const ServedModel& errors = Named(models, "errors");
  REQUIRE(errors.outputs == 4 * kSteps);
  const VectorXd at_truth = errors.evaluate(truth);
  CHECK(std::abs(at_truth.mean()) < 4 / std::sqrt(4.0 * kSteps));
  CHECK(at_truth.squaredNorm() / (4 * kSteps) == Approx(1).margin(0.2));

  // Around its maximum it falls as the Gaussian that the fit has found.
  const ServedModel& likelihood = Named(models, "log_likelihood");
  CurriculumOptions options;
  options.horizons = {1};
  const LaplaceFit fit =
      FitCurriculum(std::make_shared<Model>(robot), logs[0].rollouts, options).fit;
  const VectorXd sd = fit.posterior.covariance.diagonal().cwiseSqrt();
  const auto value = [&](const VectorXd& coordinates) {
    return likelihood.evaluate(robot.ToPhysical(coordinates))(0, 0);
  };
  for (Eigen::Index i = 0; i < 2; ++i) {
    const VectorXd step = 3 * sd(i) * VectorXd::Unit(2, i);
    const double drop = 0.5 * 9 * sd(i) * sd(i) * Inverse(fit.posterior.covariance)(i, i);
    CHECK(value(fit.mode) - value(fit.mode + step) == Approx(drop).epsilon(0.2));
    CHECK(value(fit.mode) - value(fit.mode - step) == Approx(drop).epsilon(0.2));
  }

  // Of what no robot can have.
  const Eigen::Vector2d negative(-1, 1);
  CHECK(likelihood.evaluate(negative)(0, 0) == -1e300);
  CHECK_THROWS_WITH(errors.evaluate(negative), Catch::Contains("mass/cart"));
  CHECK_THROWS_WITH(Named(models, "next_states").evaluate(negative), Catch::Contains("mass/cart"));
}

TEST_CASE("served models: without unknowns or motion there are none") {
  RobotDescription robot = Cartpole();
  const std::vector<Log> logs(1);
  CHECK_THROWS_AS(RobotModels(robot, logs, ExecutionOptions(1)), std::invalid_argument);
  const std::vector<Log> moved{Move(robot, Model(robot).parameters().means(), 0)};
  robot.parameters.clear();
  CHECK_THROWS_WITH(RobotModels(robot, moved, ExecutionOptions(1)),
                    Catch::Contains("no uncertain parameters"));
}

}  // namespace plumb
