#include "experiments/simulated_system.h"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <map>

#include "common/decompositions.h"
#include "experiments/budget.h"
#include "experiments/n_step_error.h"
#include "experiments/recording.h"
#include "sim/simulator.h"

namespace plumb {
namespace {

RobotDescription Pendulum(const std::string& file) {
  return LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/pendulum/" + file);
}

GaussianPolicy Policy(const RobotDescription& robot) {
  GaussianPolicy policy({3, {4}, 1});
  policy.action_scale = robot.effort_limits().cast<float>();
  Random random(5);
  for (float& parameter : policy.parameters) parameter = static_cast<float>(0.3 * random.Normal());
  return policy;
}

ParameterDistribution Certain(const RobotDescription& robot, const Eigen::VectorXd& physical) {
  return FirstDistribution(CalibrationStrategy::kOracle, robot, physical);
}

TEST_CASE("what is recorded without noise is what the simulator does, latency included") {
  // Where an effort changes within a control step, the task's substeps begin anew, a transition's
  // do not.
  const std::map<std::string, double> tolerances{{"gym.toml", 1e-12}, {"robot.toml", 1e-5}};
  for (const auto& [file, tolerance] : tolerances) {
    const RobotDescription robot = Pendulum(file);
    const Eigen::VectorXd hidden = DrawHidden(robot, Hidden::kPaper, 3);
    SimulatedSystem system(robot, hidden, Eigen::VectorXd::Zero(2), 3);
    const RobotEpisode episode = system.Run(Policy(robot), true, 120, 7);
    REQUIRE(episode.rollout.transitions.size() == 120);
    CHECK(episode.seconds == Approx(120 * robot.task.period));
    Simulator simulator(robot);
    simulator.SetParameters(hidden);
    for (const Transition& transition : episode.rollout.transitions) {
      CHECK(transition.duration() == Approx(robot.task.period));
      simulator.SetState(transition.q, transition.v);
      simulator.Step(transition.efforts);
      CHECK(simulator.q()(0) == Approx(transition.next_q(0)).margin(tolerance));
      CHECK(simulator.v()(0) == Approx(transition.next_v(0)).margin(tolerance));
    }
    // The truth errs by nothing, another robot by more the further it looks ahead.
    CHECK(NStepErrors(robot, Certain(robot, hidden), {episode.rollout}, 20, 2, 5, 1).maxCoeff() <
          1e3 * tolerance);
    const Eigen::VectorXd wrong =
        NStepErrors(robot, Certain(robot, 1.1 * hidden), {episode.rollout}, 20, 2, 5, 1);
    CHECK(wrong(0) > 1e-4);
    CHECK(wrong(19) > 5 * wrong(0));
  }
}

TEST_CASE("episodes are functions of seed and number; noise has the size that is claimed") {
  const RobotDescription robot = Pendulum("gym.toml");
  const Eigen::VectorXd hidden = DrawHidden(robot, Hidden::kPrior, 1);
  const Eigen::Vector2d noise(0.01, 0.2);
  SimulatedSystem system(robot, hidden, noise, 1), twin(robot, hidden, noise, 1);
  const GaussianPolicy policy = Policy(robot);
  twin.Run(policy, true, 10, 1);  // what was before does not matter
  const Rollout first = system.Run(policy, true, 200, 2).rollout,
                again = twin.Run(policy, true, 200, 2).rollout;
  REQUIRE(first.transitions.size() == again.transitions.size());
  CHECK(first.transitions.back().next_q == again.transitions.back().next_q);
  CHECK(system.Run(policy, true, 5, 3).rollout.transitions[0].q != first.transitions[0].q);
  // s' - f(s) with both readings noisy, by the simulator's own sensitivity: its sum of squares is
  // chi^2.
  Simulator simulator(robot);
  simulator.SetParameters(hidden);
  double sum = 0;
  int count = 0;
  for (const Transition& t : first.transitions) {
    const auto end = [&](double dq, double dv) {
      simulator.SetState(t.q.array() + dq, t.v.array() + dv);
      simulator.Step(t.efforts);
      return Eigen::Vector2d(simulator.q()(0), simulator.v()(0));
    };
    const Eigen::Vector2d middle = end(0, 0);
    if (std::abs(middle(1)) > 7) continue;  // the speed is clipped there
    Eigen::Matrix2d sensitivity;
    sensitivity << (end(1e-6, 0) - middle) / 1e-6, (end(0, 1e-6) - middle) / 1e-6;
    const Eigen::Matrix2d covariance =
        sensitivity * noise.cwiseAbs2().asDiagonal() * sensitivity.transpose() +
        Eigen::Matrix2d(noise.cwiseAbs2().asDiagonal());
    const Eigen::Vector2d error = middle - Eigen::Vector2d(t.next_q(0), t.next_v(0));
    sum += error.dot(covariance.inverse() * error);
    count += 2;
  }
  REQUIRE(count > 100);
  CHECK(sum / count == Approx(1).margin(5 * std::sqrt(2.0 / count)));
}

TEST_CASE("a budget is kept, and transitions are spread or the first") {
  const RobotDescription robot = Pendulum("gym.toml");
  const Eigen::VectorXd hidden = DrawHidden(robot, Hidden::kPaper, 2);
  SimulatedSystem system(robot, hidden, ReadingNoise(robot), 2);
  std::vector<Rollout> rollouts;
  for (uint32_t i = 0; i < 4; ++i)
    rollouts.push_back(system.Run(Policy(robot), true, 200, i).rollout);
  CHECK(CountTransitions(FirstTransitions(rollouts, 250)) == 250);
  CHECK(FirstTransitions(rollouts, 250).size() == 2);
  const auto spread = SpreadTransitions(rollouts, 150);
  CHECK(CountTransitions(spread) == 150);
  CHECK(spread.size() == 6);
  CHECK(spread.back().transitions[0].step > 0);
  const BudgetedFit fit = FitWithin(robot, rollouts, 5000, 1, 1);
  CHECK(fit.simulated_steps <= 5000);
  CHECK(fit.transitions >= 25);
  // g / l is what the motion tells.
  const Eigen::VectorXd mean = fit.distribution.Mean();
  CHECK(mean(0) / mean(2) == Approx(hidden(0) / hidden(2)).epsilon(0.01));
  CHECK_THROWS_AS(FitWithin(robot, rollouts, 100, 1, 1), std::invalid_argument);
}

TEST_CASE("without randomisation the robot is that of the prior's means") {
  const RobotDescription robot =
      LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/hopper");
  const auto nominal = FirstDistribution(CalibrationStrategy::kNominal, robot, {});
  for (size_t i = 0; i < robot.parameters.size(); ++i)
    CHECK(nominal.Mean()(static_cast<Eigen::Index>(i)) == Approx(robot.parameters[i].mean));
}

}  // namespace
}  // namespace plumb
