#include "calibrator/diagnostics/witnesses.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <memory>

#include "calibrator/diagnostics/model_test.h"
#include "calibrator/fit/curriculum.h"
#include "sim/touch.h"
#include "tests/calibrator/fitted_log.h"

namespace plumb {
namespace {

Misspecification Judge(const RobotDescription& robot, const std::vector<Rollout>& rollouts,
                       bool noise_known, int threads = 1) {
  std::vector<Rollout> log = rollouts;
  if (!noise_known) {
    for (Rollout& rollout : log) {
      for (Transition& t : rollout.transitions) {
        for (Eigen::VectorXd* sd : {&t.q_sd, &t.v_sd, &t.next_q_sd, &t.next_v_sd})
          sd->setConstant(std::nan(""));
      }
    }
  }
  const auto model = std::make_shared<const Model>(robot);
  CurriculumOptions options;
  options.horizons = {1};
  options.starts = 1;
  const CurriculumFit fit = FitCurriculum(model, log, options);
  int64_t steps = 0;
  const GaussianMixture posterior{{1}, {fit.fit.posterior}};
  const Misspecification found =
      TestModel({model, log, posterior, fit.one_step, fit.rows, fit.noise_sd, fit.noise_known},
                threads, &steps)
          .found;
  CHECK(steps > 0);
  return found;
}

// The hopper in one state, for one step.
struct OneState {
  RobotDescription robot = Robot("hopper/gym.toml");
  std::vector<Rollout> rollouts;

  explicit OneState(double height) {
    Transition t{};
    t.q = Eigen::VectorXd::Zero(6);
    t.q(1) = height;
    t.q.tail(3) << -0.2, -0.2, 0.2;
    t.v = Eigen::VectorXd::Zero(6);
    t.efforts.push_back({robot.task.period, Eigen::VectorXd::Zero(6)});
    t.next_q = t.q, t.next_v = t.v;
    t.q_sd = t.v_sd = t.next_q_sd = t.next_v_sd = Eigen::VectorXd::Constant(6, std::nan(""));
    rollouts.push_back({0, 0, {t}});
  }

  int Count(double noise) const {
    const auto model = std::make_shared<const Model>(robot);
    OneStep step(model, rollouts, 1);
    const WindowErrors errors(model, rollouts, 1, 1);
    return Witnesses(step, errors.rows(), model->parameters().means(),
                     Eigen::VectorXd::Constant(12, noise))
        .count();
  }
};

}  // namespace

TEST_CASE("a transition in which contact may begin within the noise is no witness") {
  // The foot's lowest point touches from some height on: found by halving.
  double touching = 0.9, free = 1.5;
  const RobotDescription robot = OneState(1).robot;
  const RobotDescription known = Model(robot).Describe(Model(robot).parameters().means());
  for (int i = 0; i < 30; ++i) {
    const double middle = (touching + free) / 2;
    (TouchFinder(known).Find(OneState(middle).rollouts[0].transitions[0].q).any() ? touching
                                                                                  : free) = middle;
  }
  CHECK(OneState(free + 0.1).Count(1e-3) == 1);
  CHECK(OneState(free + 1e-3).Count(1e-3) == 0);
  CHECK(OneState(free + 0.1).Count(0.1) == 0);
  // Ten standard deviations deep there is nothing but contact.
  CHECK(OneState(touching - 0.02).Count(1e-6) == 1);
}

TEST_CASE("witnesses are whitened as all errors are where a simulator is linear") {
  const RobotDescription robot = Robot("double_pendulum");
  const std::vector<Rollout> log = RandomLog(robot, {{}, 1e-4, 1e-4}, 60, 3);
  const auto model = std::make_shared<const Model>(robot);
  WindowErrors errors(model, log, 1, 1);
  const Eigen::VectorXd physical = model->parameters().means();
  errors.Linearise(physical);
  OneStep step(model, log, 1);
  const Witnesses witnesses(step, errors.rows(), physical, errors.noise_sd());
  REQUIRE(witnesses.count() > 40);
  const Eigen::MatrixXd all = errors.Whitened(physical);
  const Eigen::MatrixXd some = witnesses.Whiten(errors.Raw(physical));
  size_t at = 0;
  for (size_t i = 0; i < errors.rows().size() && at < witnesses.rows().size(); ++i) {
    const WindowErrors::Row &row = errors.rows()[i], &own = witnesses.rows()[at];
    if (row.window != own.window || row.coordinate != own.coordinate) continue;
    CHECK(some(static_cast<Eigen::Index>(at), 0) ==
          Approx(all(static_cast<Eigen::Index>(i), 0)).epsilon(0.02).margin(0.02));
    ++at;
  }
  CHECK(at == witnesses.rows().size());
}

TEST_CASE("noisy states: a right model is left in peace, and a wrong one is not") {
  const RobotDescription robot = Robot("hopper/gym.toml");
  for (const bool known : {false, true}) {
    const Misspecification right = Judge(robot, RandomLog(robot, {{}, 1e-3, 1e-3}, 300, 4), known);
    INFO(right.summary);
    CHECK_FALSE(right.alarm);
    CHECK_THAT(right.summary, Catch::Contains("nothing speaks against the model"));
    const Misspecification wrong =
        Judge(robot, RandomLog(robot, {{{"inertia/foot", 1.2}}, 1e-3, 1e-3}, 300, 4), known);
    INFO(wrong.summary);
    CHECK(wrong.alarm);
  }
}

TEST_CASE("a foot that reads too deep does not make the ground seem too stiff") {
  const RobotDescription robot = Robot("hopper/gym.toml");
  // Logs on which the slopes at the noisy readings themselves raise the alarm.
  for (const uint64_t seed : {3, 6, 12}) {
    const Misspecification found =
        Judge(robot, RandomLog(robot, {{}, 3e-3, 3e-3}, 1300, seed), false);
    INFO(found.summary);
    CHECK_FALSE(found.alarm);
  }
}

TEST_CASE("witnesses are the same for any number of threads") {
  const RobotDescription robot = Robot("hopper/gym.toml");
  const std::vector<Rollout> log = RandomLog(robot, {{}, 3e-3, 3e-3}, 150, 5);
  CHECK(Judge(robot, log, false, 1).summary == Judge(robot, log, false, 3).summary);
}

}  // namespace plumb
