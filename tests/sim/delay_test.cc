// Efforts that arrive late, and sensors that say how it was a while ago.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "sim/simulator.h"
#include "tests/sim/trees.h"

namespace plumb {
namespace {

using Eigen::Vector2d;
using Eigen::Vector4d;
using Eigen::VectorXd;
using Integrator = SimulationSettings::Integrator;

constexpr double kPeriod = 0.01;

RobotDescription Arm(double first_delay, double second_delay, double substep,
                     Integrator integrator = Integrator::kLeapfrog) {
  RobotDescription robot = Frictionless(LoadExample("double_pendulum"));
  robot.joints[0].dynamics.delay = first_delay;
  robot.joints[1].dynamics.delay = second_delay;
  robot.simulation.substep = substep;
  robot.simulation.integrator = integrator;
  return robot;
}

std::vector<Vector2d> Commands() { return {{4, -2}, {-5, 1}, {3, 3}, {0, -3}, {6, 2}}; }

Vector4d Whole(const Simulator& simulator) {
  Vector4d state;
  state << simulator.q(), simulator.v();
  return state;
}

// Commands one after the other, through the simulator's delays.
Vector4d RunDelayed(const RobotDescription& robot, bool as_profile = false) {
  Simulator simulator(robot);
  simulator.SetState(Vector2d(0.5, -1), Vector2d(2, 1));
  std::vector<EffortSegment> profile;
  for (const Vector2d& command : Commands()) {
    if (!as_profile) simulator.Step(command, kPeriod);
    profile.push_back({kPeriod, command});
  }
  if (as_profile) simulator.Step(profile);
  return Whole(simulator);
}

// The truth: without delays in the simulator, each effort held from the moment when it arrives;
// tiny steps.
Vector4d RunShifted(double first_delay, double second_delay) {
  Simulator simulator(Arm(0, 0, 1e-5));
  simulator.SetState(Vector2d(0.5, -1), Vector2d(2, 1));
  const std::vector<Vector2d> commands = Commands();
  const double end = kPeriod * static_cast<double>(commands.size());
  std::vector<double> times{0, end};
  for (size_t i = 0; i < commands.size(); ++i) {
    for (const double delay : {first_delay, second_delay})
      times.push_back(std::min(end, static_cast<double>(i) * kPeriod + delay));
  }
  std::sort(times.begin(), times.end());
  for (size_t i = 1; i < times.size(); ++i) {
    const double middle = (times[i - 1] + times[i]) / 2;
    const auto arrived = [&](double delay, Eigen::Index joint) {
      const double command = std::floor((middle - delay) / kPeriod);
      return command < 0 ? 0 : commands[static_cast<size_t>(command)][joint];
    };
    simulator.Step(Vector2d(arrived(first_delay, 0), arrived(second_delay, 1)),
                   times[i] - times[i - 1]);
  }
  return Whole(simulator);
}

}  // namespace

TEST_CASE("delay: efforts arrive when they should, to second order of the substep") {
  Random random(1);
  double coarse = 0, fine = 0;
  for (int i = 0; i < 40; ++i) {
    const double first = random.Uniform(0, 0.025), second = random.Uniform(0, 0.025);
    const Vector4d truth = RunShifted(first, second);
    coarse += (RunDelayed(Arm(first, second, 0.005)) - truth).norm() / 40;
    fine += (RunDelayed(Arm(first, second, 0.00125)) - truth).norm() / 40;
    CHECK((RunDelayed(Arm(first, second, 0.005)) - RunDelayed(Arm(first, second, 0.005), true))
              .norm() < 1e-12);
  }
  CHECK(coarse < 5e-3);
  CHECK(coarse / fine == Approx(16).margin(5));
  // it does matter
  CHECK((RunDelayed(Arm(0, 0, 1e-5)) - RunDelayed(Arm(0.003, 0, 1e-5))).norm() > 0.1);
}

TEST_CASE("delay: no delay is none, and as long as one control step the previous one's effort") {
  Simulator late(Arm(kPeriod, kPeriod, 0.005)), prompt(Arm(0, 0, 0.005));
  late.SetState(Vector2d(1, 0), Vector2d(0, 0));
  prompt.SetState(Vector2d(1, 0), Vector2d(0, 0));
  Vector2d before = Vector2d::Zero();
  for (const Vector2d& command : Commands()) {
    late.Step(command, kPeriod);
    prompt.Step(before, kPeriod);
    before = command;
    CHECK((Whole(late) - Whole(prompt)).norm() < 1e-12);
  }
}

TEST_CASE("delay: the end of a motion is smooth in the delay, also where substeps begin") {
  for (const auto integrator : {Integrator::kLeapfrog, Integrator::kSemiImplicit}) {
    const double substep = 0.002, step = 1e-7;
    const auto end = [&](double delay) {
      return RunDelayed(Arm(delay, 0.5 * delay, substep, integrator));
    };
    double jump = 0, kink = 0;
    Vector4d slope = Vector4d::Zero();
    for (int k = 1; k < 8; ++k) {
      // one control step: there the truth has a kink, as the last effort arrives no more
      if (k == 5) continue;
      const double at = k * substep;
      const Vector4d before = end(at - step), there = end(at), after = end(at + step);
      const Vector4d left = (there - before) / step, right = (after - there) / step;
      jump = std::max(jump, (after - before).cwiseAbs().maxCoeff());
      kink = std::max(kink, (right - left).norm() / std::max(left.norm(), right.norm()));
      slope = slope.cwiseMax(left.cwiseAbs());
    }
    CHECK(slope.minCoeff() > 0.1);  // it does depend on the delay
    CHECK(jump < 3 * slope.maxCoeff() * step);
    CHECK(kink < 0.02);
  }
}

TEST_CASE("delay: what had been commanded is recalled") {
  const RobotDescription robot = Arm(0.013, 0.0042, 0.002);
  Simulator whole(robot), resumed(robot), forgetful(robot);
  const std::vector<Vector2d> commands = Commands();
  whole.SetState(Vector2d(1, 0.2), Vector2d(0, 0));
  std::vector<EffortSegment> before;
  for (size_t i = 0; i < commands.size(); ++i) {
    if (i == 3) {
      for (Simulator* simulator : {&resumed, &forgetful}) simulator->SetState(whole.q(), whole.v());
      resumed.Recall(before);
    }
    whole.Step(commands[i], kPeriod);
    before.push_back({kPeriod, commands[i]});
    if (i < 3) continue;
    resumed.Step(commands[i], kPeriod);
    forgetful.Step(commands[i], kPeriod);
    CHECK((Whole(resumed) - Whole(whole)).norm() < 1e-12);
  }
  CHECK((Whole(forgetful) - Whole(whole)).norm() > 0.1);
  // And forgotten with the next state.
  for (Simulator* simulator : {&resumed, &forgetful}) {
    simulator->SetState(Vector2d(0, 0), Vector2d(0, 0));
    simulator->Step(commands[0], kPeriod);
  }
  CHECK(Whole(resumed) == Whole(forgetful));
}

TEST_CASE("delay: a track's mean and moment are its integrals") {
  Random random(3);
  double worst = 0;
  for (int trial = 0; trial < 200; ++trial) {
    EffortTrack track(2, 0.5);
    std::vector<std::pair<double, double>> until{{0, 0}};  // end, effort of velocity 1
    double now = 0;
    const auto append = [&] {
      const double duration = random.Uniform() < 0.2 ? 0 : random.Uniform(0, 0.02);
      const double effort = random.Uniform() < 0.3 ? until.back().second : random.Uniform(-3, 3);
      const double both[] = {7, effort};
      track.Append(both, duration);
      now += duration;
      if (duration > 0) until.emplace_back(now, effort);
    };
    for (int i = 0; i < 20; ++i) append();
    track.Advance();
    const double zero = now;
    for (int i = 0; i < 5; ++i) append();
    const double begin = random.Uniform(0, now - zero), end = begin + random.Uniform(0.001, 0.03),
                 delay = random.Uniform(0, 0.2);
    // Midpoint sums over small cells, with the borders on cells of their own.
    std::vector<double> cuts{begin, end};
    for (const auto& [time, effort] : until) {
      if (time - zero + delay > begin && time - zero + delay < end)
        cuts.push_back(time - zero + delay);
    }
    std::sort(cuts.begin(), cuts.end());
    double impulse = 0, first = 0;
    for (size_t i = 1; i < cuts.size(); ++i) {
      const double middle = (cuts[i - 1] + cuts[i]) / 2, time = middle - delay + zero;
      const auto at = std::find_if(until.begin(), until.end(),
                                   [&](const auto& segment) { return time < segment.first; });
      const double effort = at == until.end() ? until.back().second : at->second;
      impulse += effort * (cuts[i] - cuts[i - 1]);
      first += effort * (cuts[i] - cuts[i - 1]) * ((begin + end) / 2 - middle);
    }
    const EffortTrack::Moments moments = track.Over(1, begin, end, delay);
    worst = std::max({worst, std::abs(moments.mean - impulse / (end - begin)),
                      std::abs(moments.first - first) * 1e3});
  }
  CHECK(worst < 1e-10);
}

TEST_CASE(
    "delay: a track of thousands of short efforts is remembered as long as any delay, and one "
    "profile whole") {
  // 3000 efforts of 10 us: 30 ms, all within one step, the first one strong.
  RobotDescription robot = Arm(0, 0, 0.03);
  for (const double delay : {0.0, 1e-9}) {
    robot.joints[0].dynamics.delay = delay;
    Simulator simulator(robot);
    std::vector<EffortSegment> profile;
    for (int i = 0; i < 3000; ++i)
      profile.push_back({1e-5, Vector2d(i < 300 ? 10 : 1e-3 * (i % 2), 0)});
    simulator.Step(profile);
    Simulator mean(robot);
    mean.Step(Vector2d(1 + 0.45e-3, 0), 0.03);
    CHECK(std::abs(simulator.v()[0] / mean.v()[0] - 1) < 1e-3);
  }
}

TEST_CASE("delay: sensors tell of the state as it was, and of their bias") {
  const auto errors = [](double delay) {
    RobotDescription robot = Arm(0, 0, 1e-5);
    robot.joints[0].dynamics.sensor_delay = delay;
    robot.joints[1].dynamics.sensor_delay = 2 * delay;
    robot.joints[0].dynamics.sensor_bias = 0.02;
    Simulator simulator(robot);
    simulator.SetState(Vector2d(1, -0.5), Vector2d(3, -2));
    const Vector2d effort(2, -1);
    simulator.Step(effort, 0.05);
    const Vector4d far = Whole(simulator);
    simulator.Step(effort, delay);
    const Vector4d near = Whole(simulator);
    simulator.Step(effort, delay);
    const Simulator::State reading = simulator.Reading();
    const double position = std::hypot(reading.q[0] - 0.02 - near[0], reading.q[1] - far[1]);
    const double speed = std::hypot(reading.v[0] - near[2], reading.v[1] - far[3]);
    // Reading does not move the robot; setting what was read does, by next to nothing.
    const Vector4d state = Whole(simulator);
    const Vector2d q = reading.q, v = reading.v;
    CHECK(simulator.Reading().q == q);
    CHECK(Whole(simulator) == state);
    simulator.SetReading(q, v, effort);
    const Vector4d guess = Whole(simulator);
    return std::array{position, speed, (guess - state).head<2>().norm(),
                      (guess - state).tail<2>().norm()};
  };
  const auto coarse = errors(0.004), fine = errors(0.002);
  const double orders[] = {3, 2, 3, 2};
  for (size_t i = 0; i < 4; ++i) {
    INFO(i);
    CHECK(coarse[i] > 1e-9);
    CHECK(std::log2(coarse[i] / fine[i]) > orders[i] - 0.3);
  }
  CHECK(coarse[0] < 1e-4);
  CHECK(coarse[1] < 2e-2);
}

TEST_CASE("delay: sensors that are late see efforts when these arrive") {
  RobotDescription robot = Arm(0, 0, 0.001);
  robot.simulation.gravity = 0;
  for (JointDescription& joint : robot.joints)
    joint.dynamics.delay = 0.1, joint.dynamics.sensor_delay = 0.02;
  Simulator simulator(robot);
  simulator.SetState(Vector2d(0.3, 0.2), Vector2d::Zero());
  simulator.Step(Vector2d(2, 1), 0.05);
  CHECK(simulator.v() == Vector2d::Zero());
  CHECK(simulator.Reading().v == Vector2d::Zero());
  simulator.Step(Vector2d(2, 1), 0.1);
  CHECK(simulator.Reading().v[0] != 0);
}

TEST_CASE("delay: beyond what is remembered there is none") {
  RobotDescription robot = Arm(0, 0, 0.001);
  robot.joints[0].dynamics.delay = 0.6;
  CHECK_THROWS_WITH(Simulator(robot), Catch::Contains("delay/"));
  robot.joints[0].dynamics.delay = 0;
  robot.joints[1].dynamics.sensor_delay = -0.1;
  CHECK_THROWS_WITH(Simulator(robot), Catch::Contains("sensor_delay/"));
}

}  // namespace plumb
