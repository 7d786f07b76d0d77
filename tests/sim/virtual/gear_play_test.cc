#include "sim/virtual/gear_play.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "sim/model.h"
#include "sim/virtual/virtual_plant.h"
#include "tests/sim/robots.h"
#include "tests/sim/scalar.h"

namespace plumb {
namespace {

using Eigen::VectorXd;

constexpr double kGap = 0.01, kRotor = 0.02;  // [rad], [kg m^2]

/// The pendulum without gravity, with such a gear.
RobotDescription Loose(double gap = kGap) {
  const Model model(LoadPendulum("robot.toml"));
  RobotDescription robot = model.Describe(model.parameters().means());
  robot.simulation.gravity = 0;
  robot.virtual_robot.joints = {{.joint = 0, .backlash = gap, .rotor = kRotor}};
  return robot;
}

double LinkInertia(const RobotDescription& robot) {
  const LinkDescription& link = robot.links[1];
  return link.inertia(1, 1) + link.mass * link.center_of_mass.squaredNorm();
}

struct Energy {
  double momentum, kinetic;
};
Energy Of(const VirtualPlant& m, double inertia) {
  const double rotor = m.motor_v()[0], link = m.v()[0];
  return {kRotor * rotor + inertia * link, (kRotor * rotor * rotor + inertia * link * link) / 2};
}

}  // namespace

TEST_CASE(
    "play: within the gap the rotor is alone, and pushed from end to end it shows the whole gap") {
  const RobotDescription robot = Loose();
  VirtualPlant mechanism(robot);
  mechanism.SetState(Scalar(0), Scalar(0));
  CHECK(mechanism.motor_q()[0] == 0);
  // From the middle to one end: half the gap under constant acceleration; the link does not know
  // yet.
  const double effort = 0.1, reach = std::sqrt(2 * (kGap / 2) * kRotor / effort);
  REQUIRE(mechanism.Advance(Scalar(effort), 0.98 * reach));
  CHECK(mechanism.motor_q()[0] == Approx(kGap / 2 * 0.98 * 0.98).epsilon(1e-9));
  CHECK(mechanism.q()[0] == 0);
  // Held against a link that is heavy by comparison: the difference of rests is the gap and the
  // bend of the teeth.
  RobotDescription held = robot;
  held.joints[0].dynamics.friction = 1;  // that no push of 0.1 Nm overcomes: it creeps
  VirtualPlant stiff(held);
  stiff.SetState(Scalar(0), Scalar(0));
  double ends[2];
  for (int i = 0; i < 2; ++i) {
    REQUIRE(stiff.Advance(Scalar(i == 0 ? effort : -effort), 0.5));
    CHECK(stiff.motor_v()[0] == Approx(stiff.v()[0]).margin(1e-6));
    ends[i] = stiff.motor_q()[0] - stiff.q()[0];
  }
  CHECK(ends[0] - ends[1] > kGap);
  CHECK(ends[0] - ends[1] == Approx(kGap).epsilon(0.01));
}

TEST_CASE("play: the two exchange momentum, and lose energy only") {
  const RobotDescription robot = Loose(0.002);
  const double inertia = LinkInertia(robot);
  VirtualPlant mechanism(robot);
  mechanism.SetState(Scalar(0), Scalar(0));
  REQUIRE(mechanism.Advance(Scalar(0.2), 0.005));  // the rotor gets going
  const Energy begin = Of(mechanism, inertia);
  REQUIRE(mechanism.v()[0] == 0);
  REQUIRE(begin.momentum == Approx(0.2 * 0.005));
  double kinetic = begin.kinetic;
  for (int i = 0; i < 20'000; ++i) {
    REQUIRE(mechanism.Advance(Scalar(0), 1e-3));
    const Energy now = Of(mechanism, inertia);
    REQUIRE(now.momentum == Approx(begin.momentum).epsilon(1e-6));
    // The teeth give back the energy that they store between blows, and no more.
    REQUIRE(now.kinetic < begin.kinetic * (1 + 1e-9));
    kinetic = now.kinetic;
  }
  // In the end they go along together.
  CHECK(mechanism.motor_v()[0] == Approx(mechanism.v()[0]).epsilon(0.2));
  CHECK(kinetic == Approx(begin.momentum * begin.momentum / 2 / (inertia + kRotor)).epsilon(0.05));
}

TEST_CASE("play: driven to and fro the robot chatters, but nothing blows up") {
  for (const double rotor : {1e-4, 0.02, 5.0}) {
    RobotDescription robot = Loose();
    robot.simulation.gravity = 9.81;
    robot.virtual_robot.joints[0].rotor = rotor;
    VirtualPlant mechanism(robot);
    mechanism.SetState(Scalar(std::numbers::pi), Scalar(0));
    double worst = 0;
    for (int i = 0; i < 1000; ++i) {
      REQUIRE(mechanism.Advance(Scalar(i % 7 < 3 ? 2 : -2), 0.0013));
      worst = std::max(worst, std::abs(mechanism.motor_q()[0] - mechanism.q()[0]));
    }
    INFO("rotor " << rotor);
    CHECK(worst > 0.99 * kGap / 2);
    CHECK(worst < 1.1 * kGap);  // the teeth bend, they do not break
    CHECK(std::abs(mechanism.v()[0]) < 20);
  }
}

TEST_CASE("play: with no gap to speak of the rotor is an armature") {
  RobotDescription robot = Loose();
  robot.simulation.gravity = 9.81;
  robot.virtual_robot.joints[0].backlash = 1e-4;
  RobotDescription rigid = robot;
  rigid.virtual_robot.joints.clear();
  rigid.joints[0].dynamics.armature = kRotor;
  VirtualPlant loose(robot), one(rigid);
  for (VirtualPlant* mechanism : {&loose, &one}) {
    mechanism->SetState(Scalar(1), Scalar(0));
    REQUIRE(mechanism->Advance(Scalar(0.5), 1));
  }
  CHECK(loose.q()[0] == Approx(one.q()[0]).margin(2e-3));
}

TEST_CASE("play: what would act on the teeth's effort is refused") {
  RobotDescription robot = Loose();
  robot.joints[0].dynamics.motor_gain = 0.9;
  CHECK_THROWS_WITH(VirtualPlant(robot), Catch::Contains("'pivot' has backlash"));
  robot = Loose(1e-12);
  CHECK_THROWS_WITH(VirtualPlant(robot), Catch::Contains("too narrow"));
}

}  // namespace plumb
