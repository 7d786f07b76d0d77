#include "sim/simulator.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <thread>

#include "common/random.h"
#include "tests/sim/allocations.h"
#include "tests/sim/robots.h"
#include "tests/sim/scalar.h"

namespace plumb {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

/// gym's Pendulum, from its published formula.
struct GymHopper {
  double g, m, l;
  bool move_before_clip;

  double Acceleration(double q, double u) const {
    return 3 * g / (2 * l) * std::sin(q) + 3 / (m * l * l) * u;
  }
  void Step(double& q, double& v, double u) const {
    const double speed = v + 0.05 * Acceleration(q, u);
    v = std::clamp(speed, -8.0, 8.0);
    q += 0.05 * (move_before_clip ? speed : v);
  }
};

Vector3d DrawPhysical(Random& random) {
  return {random.Uniform(5, 15), random.Uniform(0.3, 3), random.Uniform(0.3, 3)};
}

}  // namespace

TEST_CASE("gym.toml steps as gym does, with either order of clip and move") {
  for (const bool move_before_clip : {false, true}) {
    RobotDescription description = LoadPendulum("gym.toml");
    CHECK_FALSE(description.simulation.move_before_clip);  // Pendulum-v1
    description.simulation.move_before_clip = move_before_clip;
    Simulator simulator(description);
    Random random(7);
    double worst = 0;
    int clipped = 0;
    for (int i = 0; i < 20000; ++i) {
      const Vector3d physical = DrawPhysical(random);
      simulator.SetParameters(physical);
      double q = random.Uniform(-10, 10), v = random.Uniform(-8, 8);
      const double u = random.Uniform(-2, 2);
      simulator.SetState(Scalar(q), Scalar(v));
      simulator.Step(Scalar(u), 0.05);
      GymHopper{physical[0], physical[1], physical[2], move_before_clip}.Step(q, v, u);
      worst = std::max({worst, std::abs(simulator.q()[0] - q), std::abs(simulator.v()[0] - v)});
      clipped += std::abs(v) == 8;
    }
    CHECK(worst < 1e-12);
    CHECK(clipped > 200);  // both orders were put to the test
  }
}

TEST_CASE("mass and length act as in gym's formula") {
  Simulator simulator(LoadPendulum("robot.toml"));
  Random random(8);
  for (int i = 0; i < 1000; ++i) {
    const Vector3d physical = DrawPhysical(random);
    const double q = random.Uniform(-4, 4), v = random.Uniform(-20, 20), u = random.Uniform(-2, 2);
    simulator.SetParameters(physical);
    simulator.SetState(Scalar(q), Scalar(v));
    const double expected =
        GymHopper{physical[0], physical[1], physical[2], false}.Acceleration(q, u);
    REQUIRE(std::abs(simulator.Acceleration(Scalar(u))[0] - expected) <
            1e-11 * (1 + std::abs(expected)));
  }
}

TEST_CASE("leapfrog is of second order, semi-implicit of first") {
  using Integrator = SimulationSettings::Integrator;
  for (const auto& [integrator, order] :
       {std::pair{Integrator::kLeapfrog, 2}, {Integrator::kSemiImplicit, 1}}) {
    RobotDescription description = LoadPendulum("robot.toml");
    description.simulation.integrator = integrator;
    const auto run = [&](double substep) {
      description.simulation.substep = substep;
      Simulator simulator(description);
      simulator.SetState(Scalar(2.5), Scalar(1));
      simulator.Step(Scalar(0.7), 0.4);
      return simulator.q()[0];
    };
    const double reference = run(1e-5);
    const double ratio = (run(0.02) - reference) / (run(0.01) - reference);
    CHECK(std::log2(ratio) == Approx(order).margin(0.12));
  }
}

TEST_CASE("a double pendulum meets the closed form") {
  // Two point-like links of length l1, l2 about parallel axes y. With absolute angles a, b from
  // upright:
  //   (m1 + m2) l1^2 a'' + m2 l1 l2 cos(a-b) b'' + m2 l1 l2 sin(a-b) b'^2
  //     - (m1 + m2) g l1 sin a = u1 - u2
  //   m2 l2^2 b'' + m2 l1 l2 cos(a-b) a'' - m2 l1 l2 sin(a-b) a'^2 - m2 g l2 sin b = u2
  const double m1 = 1.2, m2 = 0.7, l1 = 0.9, l2 = 0.6, g = 9.80665;
  RobotDescription description = LoadPendulum("robot.toml");
  description.parameters.clear();
  const Eigen::Matrix3d tiny = 1e-9 * Eigen::Matrix3d::Identity();
  description.links = {{"base"}, {"one", m1, {0, 0, l1}, tiny}, {"two", m2, {0, 0, l2}, tiny}};
  description.joints.push_back(description.joints[0]);
  description.joints[1].parent = 1;
  description.joints[1].child = 2;
  description.joints[1].origin = {0, 0, l1};
  Simulator simulator(description);
  Random random(3);
  for (int i = 0; i < 200; ++i) {
    Eigen::Vector2d q, v, u;
    for (int k = 0; k < 2; ++k) {
      q[k] = random.Uniform(-4, 4);
      v[k] = random.Uniform(-5, 5);
      u[k] = random.Uniform(-2, 2);
    }
    simulator.SetState(q, v);
    const VectorXd acceleration = simulator.Acceleration(u);
    const double a = q[0], b = q[0] + q[1], da = v[0], db = v[0] + v[1];
    const double dda = acceleration[0], ddb = acceleration[0] + acceleration[1];
    const double c = m2 * l1 * l2 * std::cos(a - b), s = m2 * l1 * l2 * std::sin(a - b);
    CHECK((m1 + m2) * l1 * l1 * dda + c * ddb + s * db * db - (m1 + m2) * g * l1 * std::sin(a) ==
          Approx(u[0] - u[1]).margin(1e-6));
    CHECK(m2 * l2 * l2 * ddb + c * dda - s * da * da - m2 * g * l2 * std::sin(b) ==
          Approx(u[1]).margin(1e-6));
  }
}

TEST_CASE("a profile moves the robot as its segments one after the other, to second order") {
  const std::vector<EffortSegment> profile = {
      {0.003, Scalar(2)}, {0, Scalar(99)}, {0.0171, Scalar(-2)}};
  const auto error = [&](double substep) {
    RobotDescription description = LoadPendulum("robot.toml");
    description.simulation.substep = substep;
    Simulator whole(description), parts(description);
    whole.Step(profile);
    for (const EffortSegment& segment : profile) {
      for (int i = 0; i < 100; ++i) parts.Step(segment.effort, segment.duration / 100);
    }
    CHECK(parts.v()[0] != 0);
    return std::hypot(whole.q()[0] - parts.q()[0], (whole.v()[0] - parts.v()[0]) * 0.02);
  };
  const double coarse = error(0.0201), fine = error(0.0201 / 4);
  CHECK(coarse < 2e-5);  // without the moment it would be u / (m l^2 / 3) * .003 * .017 / 2 = 6e-4
  CHECK(fine < coarse / 6);
}

TEST_CASE("equal inputs give equal bits, whatever came before and in any thread") {
  const RobotDescription description = MakeTree();
  const auto run = [&](int warm_up, VectorXd& result) {
    Simulator simulator(description);
    Random random(static_cast<uint64_t>(warm_up));
    for (int i = 0; i < warm_up; ++i) {
      simulator.SetState(VectorXd::Constant(4, random.Uniform(-2, 2)),
                         VectorXd::Constant(4, random.Uniform(-2, 2)));
      simulator.Step(VectorXd::Constant(4, 1.0), 0.05);
    }
    simulator.SetState(Eigen::Vector4d(0.1, 2, -1, 0.5), Eigen::Vector4d(-0.3, 4, 1, 2));
    for (int i = 0; i < 50; ++i) simulator.Step(Eigen::Vector4d(1, -2, 0.5, 0.1), 0.05);
    result.resize(8);
    result << simulator.q(), simulator.v();
  };
  VectorXd results[4];
  run(0, results[0]);
  run(17, results[1]);
  std::thread one([&] { run(5, results[2]); }), two([&] { run(40, results[3]); });
  one.join();
  two.join();
  REQUIRE(results[0].allFinite());
  for (const VectorXd& result : results) CHECK(result == results[0]);
}

TEST_CASE("the simulator refuses what is not finite and survives blowing up") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  RobotDescription description = MakeTree();
  Simulator simulator(description);
  const VectorXd zero = VectorXd::Zero(4);
  for (const double bad : {nan, infinity, -infinity}) {
    CHECK_THROWS_AS(simulator.SetState(Eigen::Vector4d(0, bad, 0, 0), zero), std::invalid_argument);
    CHECK_THROWS_AS(simulator.SetState(zero, Eigen::Vector4d(0, 0, 0, bad)), std::invalid_argument);
  }
  CHECK_THROWS_AS(simulator.SetState(Scalar(0), zero), std::invalid_argument);
  for (const double huge : {1e5, 1e100, 1e200, 1e308}) {
    simulator.SetState(VectorXd::Constant(4, huge), VectorXd::Constant(4, -huge));
    REQUIRE_NOTHROW(simulator.Step(VectorXd::Constant(4, huge), 0.05));
  }
  CHECK_FALSE(simulator.finite());
  simulator.SetState(zero, zero);
  CHECK(simulator.finite());
  REQUIRE_NOTHROW(simulator.Step(Eigen::Vector4d(nan, 0, 0, 0), 0.05));
  CHECK_FALSE(simulator.finite());
  REQUIRE_NOTHROW(simulator.Step(zero, 0.05));
  CHECK_FALSE(simulator.finite());

  // Recovery is complete.
  simulator.SetState(zero, zero);
  simulator.Step(zero, 0.05);
  Simulator fresh(description);
  fresh.Step(zero, 0.05);
  CHECK(simulator.v() == fresh.v());
}

TEST_CASE("a clip of speeds does not hide that the simulation has blown up") {
  Simulator simulator(LoadPendulum("gym.toml"));
  const double infinity = std::numeric_limits<double>::infinity();
  simulator.Step(Scalar(infinity), 0.05);
  CHECK_FALSE(simulator.finite());
  simulator.SetState(Scalar(1), Scalar(1));
  simulator.Step(Scalar(1e300), 0.05);
  CHECK(simulator.finite());
  CHECK(simulator.v()[0] == 8);
  CHECK_THROWS_AS(simulator.Step(Scalar(0), 1e18), std::invalid_argument);
}

TEST_CASE("stepping and setting parameters do not allocate") {
  Simulator tree(MakeTree());
  Simulator pendulum(LoadPendulum("robot.toml"));
  const VectorXd effort = VectorXd::Ones(4), physical = Vector3d(10, 1, 1), q = Scalar(1);
  tree.Step(effort, 0.05);
  const int64_t before = Allocations();
  tree.Step(effort, 0.05);
  pendulum.SetParameters(physical);
  pendulum.SetState(q, q);
  pendulum.Step(q, 0.05);
  CHECK(Allocations() == before);
}

TEST_CASE("joints that are not a tree are refused") {
  RobotDescription description = MakeTree();
  description.joints[1].parent = 3;
  CHECK_THROWS_AS(Simulator(description), std::invalid_argument);
}

}  // namespace plumb
