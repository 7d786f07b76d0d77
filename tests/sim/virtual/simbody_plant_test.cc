#include "sim/virtual/simbody_plant.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "common/random.h"
#include "sim/simulator.h"
#include "tests/sim/robots.h"
#include "tests/sim/scalar.h"

namespace plumb {
namespace {

using Eigen::VectorXd;

VectorXd DrawBelow(Random& random, int size, double bound) {
  VectorXd result(size);
  for (double& x : result) x = random.Uniform(-bound, bound);
  return result;
}

RobotDescription WithPriorMeans(const RobotDescription& description) {
  const Model model(description);
  return model.Describe(model.parameters().means());
}

}  // namespace

TEST_CASE("plant and simulator have the same accelerations by different equations") {
  const RobotDescription description = MakeTree();
  SimbodyPlant plant(description);
  Simulator simulator(description);
  Random random(11);
  for (int i = 0; i < 300; ++i) {
    const VectorXd q = DrawBelow(random, 4, 3), v = DrawBelow(random, 4, 6),
                   effort = DrawBelow(random, 4, 5);
    plant.SetState(q, v);
    simulator.SetState(q, v);
    const VectorXd expected = plant.Acceleration(effort);
    REQUIRE((simulator.Acceleration(effort) - expected).norm() < 1e-11 * (1 + expected.norm()));
  }
}

TEST_CASE("the plant's pendulum is gym's in continuous time") {
  const RobotDescription description = LoadPendulum("robot.toml");
  const Model model(description);
  Random random(12);
  for (int i = 0; i < 20; ++i) {
    const double g = random.Uniform(5, 15), m = random.Uniform(0.3, 3), l = random.Uniform(0.3, 3);
    SimbodyPlant plant(model.Describe(Eigen::Vector3d(g, m, l)));
    const double q = random.Uniform(-4, 4), u = random.Uniform(-2, 2);
    plant.SetState(Scalar(q), Scalar(random.Uniform(-10, 10)));
    const double expected = 3 * g / (2 * l) * std::sin(q) + 3 / (m * l * l) * u;
    CHECK(plant.Acceleration(Scalar(u))[0] == Approx(expected).epsilon(1e-11));
  }
}

TEST_CASE("the plant keeps its energy") {
  const RobotDescription description = LoadPendulum("robot.toml");
  SimbodyPlant plant(WithPriorMeans(description));
  const double g = 10.4, m = 1.04, l = 1.04;
  const auto energy = [&] {
    return m * l * l / 6 * plant.v()[0] * plant.v()[0] + m * g * l / 2 * std::cos(plant.q()[0]);
  };
  plant.SetState(Scalar(0.1), Scalar(0));
  const double before = energy();
  REQUIRE(plant.Advance(Scalar(0), 10));
  CHECK(plant.q()[0] != 0.1);
  CHECK(std::abs(energy() - before) < 1e-7);
}

TEST_CASE(
    "the plant's integrator is of fourth order and at its default far below an encoder's count") {
  const RobotDescription description = LoadPendulum("robot.toml");
  const RobotDescription robot = WithPriorMeans(description);
  const auto run = [&](SimbodyPlant&& plant, double duration) {
    plant.SetState(Scalar(-2), Scalar(8));
    REQUIRE(plant.Advance(Scalar(1), duration));
    return plant.q()[0];
  };
  const double reference = run(SimbodyPlant(robot, 0.001), 0.4);
  const double coarse = run(SimbodyPlant(robot, 0.02), 0.4) - reference;
  const double fine = run(SimbodyPlant(robot, 0.01), 0.4) - reference;
  CHECK(std::log2(coarse / fine) == Approx(4).margin(0.3));
  const double step = run(SimbodyPlant(robot), 0.005) - run(SimbodyPlant(robot, 0.001), 0.005);
  CHECK(std::abs(step) < 1e-10);
}

TEST_CASE("the simulator converges to the plant as its order says") {
  RobotDescription description = MakeTree();
  description.simulation.integrator = SimulationSettings::Integrator::kSemiImplicit;
  SimbodyPlant plant(description, 5e-4);
  const VectorXd q = Eigen::Vector4d(0.1, 1, -1, 2), v = Eigen::Vector4d(0.5, -1, 2, 1),
                 u = Eigen::Vector4d(1, 2, 0.5, -1);
  plant.SetState(q, v);
  REQUIRE(plant.Advance(u, 0.2));
  const auto error = [&](double substep) {
    description.simulation.substep = substep;
    Simulator simulator(description);
    simulator.SetState(q, v);
    simulator.Step(u, 0.2);
    return (simulator.q() - plant.q()).norm();
  };
  const double coarse = error(0.002), fine = error(0.001);
  CHECK(coarse / fine == Approx(2).epsilon(0.1));
  CHECK(fine > 1e-6);  // of the integrator, not of rounding
}

TEST_CASE("at the pendulum's substep the simulator errs far less than the sensors") {
  RobotDescription description = LoadPendulum("robot.toml");
  SimbodyPlant plant(WithPriorMeans(description));
  Simulator simulator(description);
  description.simulation.substep /= 2;
  Simulator finer(description);
  Random random(13);
  double q_error = 0, v_error = 0, finer_q_error = 0, q_square = 0, v_square = 0;
  for (int i = 0; i < 500; ++i) {
    const VectorXd q = Scalar(random.Uniform(-3.2, 3.2)), v = Scalar(random.Uniform(-8, 8)),
                   u = Scalar(random.Uniform(-2, 2));
    plant.SetState(q, v);
    REQUIRE(plant.Advance(u, description.task.period));
    for (Simulator* s : {&simulator, &finer}) {
      s->SetState(q, v);
      s->Step(u, description.task.period);
    }
    q_error = std::max(q_error, std::abs(simulator.q()[0] - plant.q()[0]));
    v_error = std::max(v_error, std::abs(simulator.v()[0] - plant.v()[0]));
    q_square += std::pow(simulator.q()[0] - plant.q()[0], 2) / 500;
    v_square += std::pow(simulator.v()[0] - plant.v()[0], 2) / 500;
    finer_q_error = std::max(finer_q_error, std::abs(finer.q()[0] - plant.q()[0]));
  }
  INFO("one-step errors: worst " << q_error << " rad, " << v_error << " rad/s, rms "
                                 << std::sqrt(q_square) << " rad, " << std::sqrt(v_square)
                                 << " rad/s");
  CHECK(q_error < 1.2e-4 / 8);  // the encoder's sd
  CHECK(std::sqrt(q_square) < 1.2e-4 / 15);
  CHECK(v_error < 1e-2 / 100);  // what filtering makes of the drive's velocity
  CHECK(q_error / finer_q_error == Approx(4).epsilon(0.1));
}

TEST_CASE("the plant stays where it is rather than leave the finite") {
  const RobotDescription description = LoadPendulum("robot.toml");
  SimbodyPlant plant(WithPriorMeans(description));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_AS(plant.SetState(Scalar(nan), Scalar(0)), std::invalid_argument);
  CHECK_THROWS_AS(plant.SetState(Scalar(0), VectorXd::Zero(2)), std::invalid_argument);
  plant.SetState(Scalar(1), Scalar(2));
  CHECK_FALSE(plant.Advance(Scalar(nan), 0.01));
  CHECK_FALSE(plant.Advance(Scalar(1e308), 10));
  CHECK(std::isfinite(plant.v()[0]));
  plant.SetState(Scalar(1), Scalar(2));
  CHECK(plant.Advance(Scalar(0), 0.01));
  RobotDescription broken = description;
  broken.links[1].mass = -1;
  CHECK_THROWS_AS(SimbodyPlant(broken), std::invalid_argument);
}

}  // namespace plumb
