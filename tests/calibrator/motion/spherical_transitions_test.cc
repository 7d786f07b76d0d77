// Transitions of a robot whose trunk turns freely: q has more entries than v.

#include <catch2/catch.hpp>
#include <cmath>
#include <memory>

#include "calibrator/fit/discrepancy.h"
#include "calibrator/fit/streaming.h"
#include "calibrator/fit/window_errors.h"
#include "calibrator/live/simopt.h"
#include "calibrator/motion/transitions.h"
#include "robot/configuration_space.h"
#include "robot/parameter_distribution.h"
#include "sim/simulator.h"
#include "tests/calibrator/synthetic.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

constexpr int kQ = 19, kV = 18;

/// Of which nothing is uncertain but the trunk's mass.
RobotDescription Quadruped() {
  RobotDescription robot = LoadRobot(SourceFile("robots/quadruped"));
  robot.parameters.resize(1);
  robot.virtual_robot.hidden.resize(1);
  return robot;
}

robot_state_t QuadrupedState(int64_t sequence) {
  robot_state_t s{};
  s.sequence = sequence;
  s.utime = 7'000'000 + 5000 * sequence;
  s.num_positions = kQ, s.num_velocities = kV;
  s.q.assign(kQ, 0.1);
  s.q[3] = s.q[4] = s.q[5] = s.q[6] = 0.5;
  s.v.assign(kV, 0.2);
  s.q_sd.assign(kV, 1e-3);
  s.v_sd.assign(kV, 1e-2);
  s.effort.assign(kV, 0);
  s.valid = 1;
  return s;
}

joint_command_t QuadrupedCommand(int step) {
  joint_command_t c{};
  c.state_sequence = 100 + 4 * step;
  c.episode = 42;
  c.step = step;
  c.num_joints = 16;
  return c;
}

TEST_CASE("a transition has the sizes of q and v; a quaternion that is none is dropped") {
  TransitionJoiner joiner(Quadruped());
  for (int64_t i = 90; i <= 150; ++i) {
    robot_state_t state = QuadrupedState(i);
    if (i == 104) state.q[3] += 3e-6;  // the end of one transition, the beginning of the next
    joiner.OnState(state);
  }
  for (int step = 0; step < 10; ++step) joiner.OnCommand(QuadrupedCommand(step));
  robot_state_t flat = QuadrupedState(120);
  flat.num_positions = kV, flat.q.resize(kV);
  joiner.OnState(flat);
  const Rollout rollout = joiner.Join(42, 140);
  REQUIRE(rollout.transitions.size() == 8);
  CHECK(joiner.drops().not_finite == 2);
  const Transition& t = rollout.transitions[0];
  CHECK(t.q.size() == kQ);
  CHECK(t.v.size() == kV);
  CHECK(t.q_sd.size() == kV);
  CHECK(t.next_q_sd.size() == kV);
  CHECK(t.efforts[0].effort.size() == kV);
}

TEST_CASE("starts go through their message whole, and one with a forged quaternion does not") {
  const RobotDescription robot = Quadruped();
  ParameterDistribution distribution = ParameterDistribution::Prior(robot);
  Eigen::VectorXd start = Eigen::VectorXd::LinSpaced(kQ + kV, 0, 1);
  start.segment<4>(3) << 0.5, -0.5, 0.5, 0.5;
  distribution.starts = {start};
  parameter_distribution_t message = distribution.ToMessage();
  const auto heard = ParameterDistribution::FromMessage(message, robot);
  REQUIRE(heard.starts.size() == 1);
  CHECK((heard.starts[0] - start).norm() < 1e-6);
  Random random(1);
  SimulatorDraw draw{Eigen::VectorXd()};
  while (draw.start.size() == 0) draw = heard.Draw(random);
  CHECK(draw.start == heard.starts[0]);
  message.start[4] = 0;
  CHECK_THROWS_WITH(ParameterDistribution::FromMessage(message, robot),
                    Catch::Contains("start: q of base/rotation (0.5, 0, 0.5, 0.5) is no unit"));
}

// Steps of 20 ms from states with noise of known size, which turn any way.
std::vector<Rollout> QuadrupedRollouts(const RobotDescription& robot, double mass, int steps,
                                       double q_sd, double v_sd) {
  const ConfigurationSpace space(robot);
  Simulator simulator(robot);
  simulator.SetParameters(Eigen::VectorXd::Constant(1, mass));
  Random random(5, {6});
  const auto noise = [&](double sd) {
    Eigen::VectorXd values(kV);
    for (double& x : values) x = sd * random.Normal();
    return values;
  };
  Rollout rollout;
  for (int step = 0; step < steps; ++step) {
    Transition t;
    t.step = 2 * step;  // each on its own
    Eigen::VectorXd q(kQ);
    q << 0, 0, 0.5 + 0.1 * random.Normal(),
        Eigen::Vector4d(random.Normal(), random.Normal(), random.Normal(), random.Normal())
            .normalized(),
        Eigen::VectorXd::Zero(12);
    for (Eigen::Index i = 0; i < 12; ++i)
      q[7 + i] = robot.joints[4 + static_cast<size_t>(i)].dynamics.rest + 0.1 * random.Normal();
    const Eigen::VectorXd v = noise(0.5);
    Eigen::VectorXd effort = 5 * noise(1);
    effort.head<6>().setZero();
    t.efforts = {{0.02, effort}};
    simulator.SetState(q, v);
    simulator.Step(t.efforts);
    t.q = space.Move(q, noise(q_sd)), t.v = v + noise(v_sd);
    t.next_q = space.Move(simulator.q(), noise(q_sd)), t.next_v = simulator.v() + noise(v_sd);
    t.q_sd = t.next_q_sd = Eigen::VectorXd::Constant(kV, q_sd);
    t.v_sd = t.next_v_sd = Eigen::VectorXd::Constant(kV, v_sd);
    rollout.transitions.push_back(std::move(t));
  }
  return {rollout};
}

TEST_CASE("errors of the right simulator are zero, or what noise makes of them") {
  const RobotDescription robot = Quadruped();
  const Eigen::VectorXd mass = Eigen::VectorXd::Constant(1, 7.3);
  const auto exact = QuadrupedRollouts(robot, 7.3, 10, 0, 0);
  WindowErrors errors(std::make_shared<Model>(robot), exact, 1, 1);
  CHECK(errors.rows().size() == 10 * 2 * kV);
  CHECK(errors.Raw(mass).cwiseAbs().maxCoeff() < 1e-12);
  CHECK(Discrepancy(robot).PredictionError(mass, exact, 1)(0) < 1e-12);

  const auto noisy = QuadrupedRollouts(robot, 7.3, 60, 1e-3, 1e-2);
  WindowErrors whitened(std::make_shared<Model>(robot), noisy, 1, 1);
  REQUIRE(whitened.Linearise(mass));
  const Eigen::VectorXd w = whitened.Whitened(mass);
  const auto count = static_cast<double>(w.size());
  CHECK(w.squaredNorm() / count == Approx(1).margin(5 * std::sqrt(2 / count)));
  // Of the trunk's rotation alone.
  double squares = 0, entries = 0;
  for (size_t i = 0; i < whitened.rows().size(); ++i) {
    const int c = whitened.rows()[i].coordinate;
    if (c < 3 || c >= 6) continue;
    squares += std::pow(w(static_cast<Eigen::Index>(i)), 2);
    ++entries;
  }
  CHECK(squares / entries == Approx(1).margin(5 * std::sqrt(2 / entries)));
}

TEST_CASE("a trunk's mass is found where all states are noisy") {
  const RobotDescription robot = Quadruped();
  const auto rollouts = QuadrupedRollouts(robot, 7.9, 120, 1e-4, 1e-3);
  StreamingLaplace stream(std::make_shared<Model>(robot));
  for (const Transition& t : rollouts[0].transitions) stream.Add(t);
  CHECK(stream.Settle());
  const Gaussian found = stream.posterior();
  const double truth = std::log(7.9), sd = std::sqrt(found.covariance(0, 0));
  INFO(found.mean(0) << " +- " << sd << ", truth " << truth);
  CHECK(sd < 0.02);
  CHECK(std::abs(found.mean(0) - truth) < 4 * sd);
  const Gaussian batch = LaplacePosterior(robot, rollouts, found.mean);
  // There free motion carries the noise of the states that steps begin with.
  CHECK(std::abs(batch.mean(0) - truth) < 0.01);
}

}  // namespace
}  // namespace plumb
