// Two ways to the same equations of motion: ours, of composite rigid bodies, and Simbody's.
#include <algorithm>
#include <catch2/catch.hpp>
#include <set>

#include "sim/simulator.h"
#include "sim/virtual/simbody_plant.h"
#include "tests/sim/trees.h"

namespace plumb {
namespace {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

// The farthest that any of them was off so far, relative to what it is about.
struct Differences {
  double mass = 0, bias = 0, force = 0;
};

// Mass matrices by their diagonal, so that metres and radians compare.
double Distance(const MatrixXd& one, const MatrixXd& other) {
  const VectorXd scale = other.diagonal().cwiseSqrt().cwiseInverse();
  return (scale.asDiagonal() * (one - other) * scale.asDiagonal()).cwiseAbs().maxCoeff();
}

void Compare(const RobotDescription& robot, int states, Random& random, Differences* worst) {
  Simulator simulator(robot);
  SimbodyPlant plant(robot);
  MatrixXd armature = MatrixXd::Zero(robot.num_velocities(), robot.num_velocities());
  Eigen::Index at = 0;
  for (const JointDescription& joint : robot.joints) {
    for (int k = 0; k < joint.num_velocities(); ++k, ++at)
      armature(at, at) = joint.dynamics.armature;
  }
  double weight = 0;  // [N]: what to measure a bias by that vanishes
  for (const LinkDescription& link : robot.links) weight += link.mass * robot.simulation.gravity;
  for (int i = 0; i < states; ++i) {
    const VectorXd q = DrawPosition(robot, random),
                   v = DrawNumbers(robot.num_velocities(), random, 5),
                   effort = DrawNumbers(robot.num_velocities(), random, 20);
    simulator.SetState(q, v);
    plant.SetState(q, v);
    const MatrixXd mass = plant.MassMatrix() + armature;
    const VectorXd bias = plant.Bias();
    worst->mass = std::max(worst->mass, Distance(simulator.MassMatrix(), mass));
    worst->bias = std::max(worst->bias, (simulator.Bias() - bias).norm() / (bias.norm() + weight));
    // Accelerations by the forces that they are worth: a robot that is all but singular has large
    // ones.
    const VectorXd acceleration = simulator.Acceleration(effort);
    const double size = effort.norm() + bias.norm();
    worst->force = std::max(worst->force, (mass * acceleration - (effort - bias)).norm() / size);
    if (armature.isZero()) {
      worst->force = std::max(worst->force,
                              (mass * (acceleration - plant.Acceleration(effort))).norm() / size);
    }
  }
}

void CheckClose(const Differences& worst, double bound = 1e-10) {
  CHECK(worst.mass < bound);
  CHECK(worst.bias < bound);
  CHECK(worst.force < bound);
}

// Of a topology with and without its being planar.
double PlanarAgainstSpatial(const RobotDescription& robot, Random& random) {
  const Topology planar(robot);
  Topology spatial = planar;
  spatial.planar = false;
  const Parameters parameters(robot, planar);
  const auto one = MakeEngine(planar, robot.simulation, parameters.terms());
  const auto other = MakeEngine(spatial, robot.simulation, parameters.terms());
  const int n = robot.num_velocities();
  const double h = 1e-3;
  const VectorXd q = DrawPosition(robot, random), v = DrawNumbers(n, random, 5),
                 effort = DrawNumbers(n, random, 20);
  for (const auto& engine : {one.get(), other.get()}) {
    engine->SetPhysics(0, parameters.Nominal());
    std::copy(q.begin(), q.end(), engine->q());
    std::copy(v.begin(), v.end(), engine->v());
  }
  const VectorXd a = VectorXd::Map(one->Bias(), n), b = VectorXd::Map(other->Bias(), n);
  double worst = (a - b).norm() / (b.norm() + 1);
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const MatrixXd left = RowMajor::Map(one->MassMatrix(), n, n),
                 right = RowMajor::Map(other->MassMatrix(), n, n);
  worst = std::max(
      worst, Distance(left.selfadjointView<Eigen::Lower>(), right.selfadjointView<Eigen::Lower>()));
  for (const auto& engine : {one.get(), other.get()}) engine->Substep(&h, effort.data(), nullptr);
  const MatrixXd mass = right.selfadjointView<Eigen::Lower>();
  const VectorXd change = VectorXd::Map(one->v(), n) - VectorXd::Map(other->v(), n);
  worst = std::max(worst, (mass * change).norm() / (mass * v).norm());
  return worst;
}

}  // namespace

TEST_CASE("trees: the examples move as Simbody's") {
  for (const char* name :
       {"pendulum/robot.toml", "pendulum/gym.toml", "cartpole", "double_pendulum", "hopper"}) {
    INFO(name);
    RobotDescription robot = Frictionless(LoadExample(name));
    Random random(1);
    Differences worst;
    Compare(robot, 200, random, &worst);
    for (JointDescription& joint : robot.joints) joint.dynamics.armature = 0;
    Compare(robot, 200, random, &worst);  // and Simbody's articulated bodies
    CheckClose(worst, 1e-11);
    CHECK(Topology(robot).planar);
    CHECK(PlanarAgainstSpatial(robot, random) < 1e-12);
  }
}

TEST_CASE("trees: far from where it started a robot moves as at home") {
  const RobotDescription robot = Frictionless(LoadExample("hopper"));
  Simulator simulator(robot);
  Random random(2);
  for (int i = 0; i < 100; ++i) {
    VectorXd q = DrawPosition(robot, random);
    const VectorXd v = DrawNumbers(6, random, 5);
    simulator.SetState(q, v);
    const MatrixXd mass = simulator.MassMatrix();
    const VectorXd bias = simulator.Bias();
    q[0] += 1e6;
    q[1] -= 3e5;
    simulator.SetState(q, v);
    REQUIRE(Distance(simulator.MassMatrix(), mass) < 1e-9);
    REQUIRE((simulator.Bias() - bias).norm() < 1e-9 * bias.norm());
  }
}

TEST_CASE("trees: two hundred at random, of all of URDF's joints, move as Simbody's") {
  Random random(3);
  Differences worst;
  std::multiset<JointDescription::Type> types;
  int planar = 0, most = 0;
  for (uint64_t seed = 0; seed < 200; ++seed) {
    INFO("seed " << seed);
    const RobotDescription robot = FromUrdf(TreeWriter(seed).Spatial(12));
    for (const JointDescription& joint : robot.joints) types.insert(joint.type);
    most = std::max(most, robot.num_velocities());
    planar += Topology(robot).planar;
    Compare(robot, 3, random, &worst);
    if (worst.mass > 1e-10 || worst.bias > 1e-10 || worst.force > 1e-10) FAIL("not Simbody's");
  }
  CheckClose(worst);
  for (const auto type : {JointDescription::Type::kRevolute, JointDescription::Type::kContinuous,
                          JointDescription::Type::kPrismatic, JointDescription::Type::kSpherical}) {
    CHECK(types.count(type) > 100);
  }
  CHECK(most > 25);
  CHECK(planar < 40);  // some have but one joint
}

TEST_CASE("trees: in any plane the planar equations are Simbody's and the spatial ones'") {
  Random random(4);
  Differences worst;
  double apart = 0;
  int joints = 0;
  for (uint64_t seed = 0; seed < 150; ++seed) {
    INFO("seed " << seed);
    Vector3d normal = DrawDirection(random);        // tilted,
    if (seed % 3 == 0) normal.z() = 0;              // upright,
    if (seed % 3 == 1) normal = Vector3d::UnitZ();  // level
    const RobotDescription robot = FromUrdf(TreeWriter(1000 + seed).Planar(12, normal));
    REQUIRE(Topology(robot).planar);
    joints += robot.num_velocities();
    Compare(robot, 3, random, &worst);
    apart = std::max(apart, PlanarAgainstSpatial(robot, random));
    if (worst.mass > 1e-10 || worst.bias > 1e-10 || worst.force > 1e-10) FAIL("not Simbody's");
  }
  CheckClose(worst);
  CHECK(apart < 1e-11);
  CHECK(joints > 1000);
}

TEST_CASE("trees: armature is added to the joint's own inertia, and to nothing else's") {
  Random random(5);
  for (uint64_t seed = 0; seed < 20; ++seed) {
    RobotDescription robot = FromUrdf(TreeWriter(seed).Spatial(8));
    const VectorXd q = DrawPosition(robot, random),
                   v = DrawNumbers(robot.num_velocities(), random, 5);
    Simulator bare(robot);
    bare.SetState(q, v);
    VectorXd armature(robot.num_velocities());
    Eigen::Index at = 0;
    for (JointDescription& joint : robot.joints) {
      joint.dynamics.armature = random.Uniform(0, 3);
      for (int k = 0; k < joint.num_velocities(); ++k) armature[at++] = joint.dynamics.armature;
    }
    Simulator geared(robot);
    geared.SetState(q, v);
    REQUIRE(Distance(geared.MassMatrix(), bare.MassMatrix() + MatrixXd(armature.asDiagonal())) <
            1e-14);
    REQUIRE(geared.Bias() == bare.Bias());
  }
}

}  // namespace plumb
