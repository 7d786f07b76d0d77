#include "calibrator/diagnostics/corrected_prediction.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>

#include "calibrator/diagnostics/holdout.h"
#include "sim/environment.h"
#include "tests/sim/residuals.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

// What the environment does under random actions, recorded without noise.
Rollout RecordRollout(Environment& environment, const RobotDescription& robot, int steps) {
  Rollout rollout;
  Random random(3);
  environment.Reset(random);
  Eigen::VectorXf action(environment.action_size());
  for (int step = 0; step < steps; ++step) {
    Transition t;
    t.step = step;
    t.q = environment.q(), t.v = environment.v();
    for (float& a : action) a = static_cast<float>(random.Uniform(-1, 1));
    if (environment.Step(action).terminated) break;
    t.efforts = {{robot.task.period, environment.effort()}};
    t.next_q = environment.q(), t.next_v = environment.v();
    t.q_sd = t.next_q_sd = Eigen::VectorXd::Constant(t.q.size(), 1e-6);
    t.v_sd = t.next_v_sd = Eigen::VectorXd::Constant(t.v.size(), 1e-6);
    rollout.transitions.push_back(t);
  }
  return rollout;
}

}  // namespace

TEST_CASE("a robot that is simulator and residual is predicted by both, however far ahead") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/hopper/gym.toml"));
  const auto model = std::make_shared<const Model>(robot);
  const auto residual = Of(robot);
  residual->free = Constant(robot, Eigen::VectorXd::Constant(6, 0.125));
  residual->touching = Constant(robot, Eigen::VectorXd::Constant(6, -0.0625));
  Environment environment(model);
  environment.SetResidual(residual);
  const std::vector<Rollout> rollouts{RecordRollout(environment, robot, 40)};
  REQUIRE(rollouts[0].transitions.size() > 10);

  // Noise, and what is unknown, are not predicted.
  residual->touching->noise.diagonal().setConstant(1);
  residual->touching->unknown.setConstant(1);
  const Eigen::VectorXd physical = model->parameters().means();
  const std::array<int, 3> horizons{1, 10, 1000};
  const Eigen::VectorXd errors =
      CorrectedPredictionErrors(model, physical, *residual, rollouts, horizons);
  CHECK(errors[0] < 1e-9);
  CHECK(errors[1] < 1e-7);
  CHECK(std::isnan(errors[2]));

  residual->touching.reset();
  const Eigen::VectorXd less =
      CorrectedPredictionErrors(model, physical, *residual, rollouts, horizons);
  CHECK(less[0] > 1e-3);
  CHECK(less[1] > less[0]);
}

TEST_CASE("a residual's predictions stand beside those without it") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/hopper/gym.toml"));
  const auto model = std::make_shared<const Model>(robot);
  const auto residual = Of(robot);
  residual->free = residual->touching = Constant(robot, Eigen::VectorXd::Constant(6, 0.125));
  Environment environment(model);
  environment.SetResidual(residual);
  const std::vector<Rollout> rollouts{RecordRollout(environment, robot, 40)};
  const Split split{{}, rollouts};
  Discrepancy discrepancy(robot);
  const Eigen::VectorXd physical = model->parameters().means();
  Holdout holdout = Judge(discrepancy, split, physical, physical);
  REQUIRE(std::isnan(holdout.errors[0].corrected));
  JudgeResidual(model, *residual, split, physical, &holdout);
  CHECK(holdout.errors[0].posterior > 1e-3);
  CHECK(holdout.errors[0].corrected < 1e-9);
  CHECK_THAT(holdout.summary, Catch::Contains("with the residual of what was fitted"));
}

}  // namespace plumb
