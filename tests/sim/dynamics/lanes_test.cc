// Robots side by side: each must move as it would alone, to the bit, whatever happens to its
// neighbours.
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "sim/model.h"
#include "tests/sim/trees.h"

namespace plumb {
namespace {

using Eigen::VectorXd;

bool SameBitPattern(double a, double b) {
  return (std::isnan(a) && std::isnan(b)) ||
         std::bit_cast<uint64_t>(a) == std::bit_cast<uint64_t>(b);
}

// Everything that the equations have: ground, stops, friction, springs, speed limits, sensors.
RobotDescription Everything(RobotDescription robot, Random& random) {
  robot.parameters.clear();
  robot.frozen.clear();
  robot.virtual_robot.hidden.clear();
  robot.simulation.contact = {
      .stiffness = 2e4, .damping = 200, .friction = 0.9, .slip_speed = 0.05};
  robot.simulation.stop = {.stiffness = 5000, .damping = 20};
  robot.simulation.substep = 0.002;
  for (JointDescription& joint : robot.joints) {
    if (joint.type == JointDescription::Type::kSpherical) continue;
    joint.dynamics.damping += random.Uniform(0, 0.1);
    joint.dynamics.friction += random.Uniform(0, 0.5);
    joint.dynamics.stiffness += random.Uniform(0, 20);
    joint.dynamics.armature += random.Uniform(0, 0.1);
    joint.dynamics.no_load_speed = 8;
    joint.dynamics.sensor_delay = 0.003;
    joint.dynamics.sensor_bias = 0.01;
    if (joint.type == JointDescription::Type::kRevolute) joint.lower = -1, joint.upper = 1;
  }
  for (size_t i = 1; i < robot.links.size(); ++i) {
    if (!robot.links[i].collisions.empty() || robot.links[i].mass == 0) continue;
    Shape shape;
    shape.type = i % 2 ? Shape::Type::kCapsule : Shape::Type::kBox;
    shape.size = i % 2 ? Eigen::Vector3d(0.05, 0.3, 0) : Eigen::Vector3d(0.1, 0.2, 0.3);
    shape.position = robot.links[i].center_of_mass;
    robot.links[i].collisions.push_back(shape);
  }
  return robot;
}

// Differences from lane to lane without being a parameter of the description.
Physics<double> Vary(Physics<double> physics, Random& random) {
  for (auto& link : physics.links) {
    const double factor = random.Uniform(0.7, 1.4);
    link.mass *= factor;
    for (double& entry : link.inertia) entry *= factor;
    for (double& entry : link.origin) entry *= random.Uniform(0.9, 1.1);
  }
  for (auto& axis : physics.axes)
    axis.damping += random.Uniform(0, 0.1), axis.motor_gain = random.Uniform(0.8, 1.2);
  physics.world.gravity = random.Uniform(5, 12);
  physics.world.contact.stiffness *= random.Uniform(0.5, 2);
  physics.world.contact.friction = random.Uniform(0, 1.5);
  return physics;
}

struct Tally {
  int compared = 0, finite = 0;
};

// The trouble of one lane.
enum class Trouble { kNone, kNaN, kHugeAngle, kInfiniteSpeed, kHugeEffort, kSteady };

void CompareLanes(const RobotDescription& robot, Trouble trouble, Random& random, Tally* tally) {
  const Model model(robot);
  const std::unique_ptr<Engine> wide = model.NewWideEngine();
  const auto lanes = static_cast<size_t>(wide->lanes());
  const auto positions = static_cast<size_t>(model.num_positions()),
             n = static_cast<size_t>(model.num_velocities());
  std::vector<std::unique_ptr<Engine>> alone;
  std::vector<std::vector<double>> efforts(lanes, std::vector<double>(n)), moments = efforts;
  std::vector<double> effort(n * lanes), moment(n * lanes);
  std::vector<double> h(lanes);
  for (double& one : h) one = random.Uniform(0.0005, 0.004);
  const size_t bad = static_cast<size_t>(random.Uniform(0, static_cast<double>(lanes)));
  for (size_t lane = 0; lane < lanes; ++lane) {
    alone.push_back(model.NewEngine());
    const Physics<double> physics = Vary(model.parameters().Nominal(), random);
    wide->SetPhysics(static_cast<int>(lane), physics);
    alone[lane]->SetPhysics(0, physics);
    VectorXd q = DrawPosition(robot, random, 2),
             v = DrawNumbers(static_cast<Eigen::Index>(n), random, 6);
    if (lane == bad && trouble == Trouble::kNaN) v[0] = std::nan("");
    if (lane == bad && trouble == Trouble::kHugeAngle) q[q.size() - 1] = random.Uniform(2e5, 1e9);
    if (lane == bad && trouble == Trouble::kInfiniteSpeed)
      v[v.size() - 1] = std::numeric_limits<double>::infinity();
    for (size_t i = 0; i < positions; ++i)
      wide->q()[i * lanes + lane] = alone[lane]->q()[i] = q[static_cast<Eigen::Index>(i)];
    for (size_t i = 0; i < n; ++i)
      wide->v()[i * lanes + lane] = alone[lane]->v()[i] = v[static_cast<Eigen::Index>(i)];
  }
  int step = 0;
  const auto compare = [&](const double* one, size_t count, auto&& other) {
    for (size_t lane = 0; lane < lanes; ++lane) {
      const double* expected = other(*alone[lane], lane);
      for (size_t i = 0; i < count; ++i) {
        if (!SameBitPattern(one[i * lanes + lane], expected[i])) {
          FAIL("step " << step << " lane " << lane << " entry " << i << ": "
                       << one[i * lanes + lane] << " for " << expected[i]);
        }
        ++tally->compared;
        tally->finite += std::isfinite(expected[i]);
      }
    }
  };
  for (; step < 12; ++step) {
    for (size_t lane = 0; lane < lanes; ++lane) {
      for (size_t i = 0; i < n; ++i) {
        const double size = lane == bad && trouble == Trouble::kHugeEffort ? 1e300 : 20;
        efforts[lane][i] = effort[i * lanes + lane] = random.Uniform(-size, size);
        moments[lane][i] = moment[i * lanes + lane] =
            h[lane] * h[lane] / 8 * random.Uniform(-size, size);
        // which alone it need not say
        if (lane == bad && trouble == Trouble::kSteady) moment[i * lanes + lane] = 0;
      }
    }
    const bool with_moment = step % 3 == 2;
    wide->Substep(h.data(), effort.data(), with_moment ? moment.data() : nullptr);
    for (size_t lane = 0; lane < lanes; ++lane) {
      const bool steady = lane == bad && trouble == Trouble::kSteady;
      alone[lane]->Substep(&h[lane], efforts[lane].data(),
                           with_moment && !steady ? moments[lane].data() : nullptr);
    }
    compare(wide->q(), positions, [](Engine& engine, size_t) { return engine.q(); });
    compare(wide->v(), n, [](Engine& engine, size_t) { return engine.v(); });
    if (step % 4) continue;
    compare(wide->Acceleration(effort.data()), n,
            [&](Engine& engine, size_t lane) { return engine.Acceleration(efforts[lane].data()); });
    compare(wide->Bias(), n, [](Engine& engine, size_t) { return engine.Bias(); });
    wide->ToReading(effort.data());
    for (size_t lane = 0; lane < lanes; ++lane) alone[lane]->ToReading(efforts[lane].data());
    compare(wide->q(), positions, [](Engine& engine, size_t) { return engine.q(); });
    wide->FromReading(effort.data());
    for (size_t lane = 0; lane < lanes; ++lane) alone[lane]->FromReading(efforts[lane].data());
    compare(wide->v(), n, [](Engine& engine, size_t) { return engine.v(); });
  }
}

void CompareAll(const RobotDescription& robot, Random& random, Tally* tally) {
  for (const auto integrator :
       {SimulationSettings::Integrator::kSemiImplicit, SimulationSettings::Integrator::kLeapfrog}) {
    RobotDescription description = robot;
    description.simulation.integrator = integrator;
    for (const Trouble trouble :
         {Trouble::kNone, Trouble::kNaN, Trouble::kHugeAngle, Trouble::kInfiniteSpeed,
          Trouble::kHugeEffort, Trouble::kSteady}) {
      INFO("trouble " << static_cast<int>(trouble));
      CompareLanes(description, trouble, random, tally);
    }
  }
}

}  // namespace

TEST_CASE("lanes: the examples side by side have the bits they have alone") {
  Random random(1);
  Tally tally;
  for (const char* name :
       {"pendulum/robot.toml", "pendulum/gym.toml", "cartpole", "double_pendulum", "hopper"}) {
    INFO(name);
    for (int i = 0; i < 20; ++i) CompareAll(LoadExample(name), random, &tally);
    for (int i = 0; i < 20; ++i) CompareAll(Everything(LoadExample(name), random), random, &tally);
  }
  CHECK(tally.compared > 100000);
  // of two lanes, one is in trouble in two thirds of the runs
  CHECK(tally.finite > 0.6 * tally.compared);
}

TEST_CASE("lanes: trees in space, too") {
  Random random(2);
  Tally tally;
  for (uint64_t seed = 0; seed < 60; ++seed) {
    INFO("seed " << seed);
    CompareAll(Everything(FromUrdf(TreeWriter(seed).Spatial(8)), random), random, &tally);
    CompareAll(
        Everything(FromUrdf(TreeWriter(seed).Planar(8, Eigen::Vector3d(1, seed % 2 ? 0 : 2, 0))),
                   random),
        random, &tally);
  }
  CHECK(tally.finite > 0.6 * tally.compared);
}

TEST_CASE("lanes: links that touch each other, too") {
  Random random(3);
  Tally tally;
  int robots = 0;
  for (uint64_t seed = 0; seed < 40; ++seed) {
    INFO("seed " << seed);
    RobotDescription robot = Everything(FromUrdf(TreeWriter(seed).Spatial(8)), random);
    Shape block{.type = Shape::Type::kBox, .size = {0.5, 0.5, 0.5}};
    robot.links[0].collisions.push_back(block);
    robot.simulation.link_pairs = {{"*", "*"}};
    CompareAll(robot, random, &tally);
    robots += Model(robot).topology().pairs.size() > 1;
  }
  CHECK(robots > 20);
  CHECK(tally.finite > 0.6 * tally.compared);
}

TEST_CASE("lanes: a lane is only its own") {
  const Model model(LoadExample("hopper"));
  const std::unique_ptr<Engine> wide = model.NewWideEngine();
  CHECK(wide->lanes() >= 2);
  CHECK((wide->lanes() & (wide->lanes() - 1)) == 0);
  const auto lanes = static_cast<size_t>(wide->lanes());
  for (size_t i = 0; i < 6 * lanes; ++i) CHECK(wide->q()[i] == 0);
  Physics<double> heavy = model.parameters().Nominal();
  for (auto& link : heavy.links) link.mass *= 2;
  const std::vector<double> before(wide->MassMatrix(), wide->MassMatrix() + 36 * lanes);
  wide->SetPhysics(1, heavy);
  const double* after = wide->MassMatrix();
  for (size_t lane = 0; lane < lanes; ++lane)
    CHECK(after[lane] == before[lane] * (lane == 1 ? 2 : 1));
}

}  // namespace plumb
