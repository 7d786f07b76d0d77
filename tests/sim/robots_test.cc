// The robots that come with the house.
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "sim/environment.h"
#include "sim/tasks/task.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

constexpr double kPi = std::numbers::pi;

RobotDescription LoadExample(const std::string& name) {
  return LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/" + name);
}

}  // namespace

TEST_CASE("the hopper is gym's") {
  for (const char* file : {"hopper/robot.toml", "hopper/paper.toml"}) {
    const RobotDescription hopper = LoadExample(file);
    CHECK(hopper.warnings.empty());
    REQUIRE(hopper.num_joints() == 6);
    const char* names[] = {"rootx", "rootz", "rooty", "thigh", "leg", "foot"};
    for (size_t i = 0; i < 6; ++i) {
      const JointDescription& joint = hopper.joints[i];
      CHECK(joint.name == names[i]);
      CHECK(joint.passive == (i < 3));
      CHECK(joint.dynamics.armature == (i < 3 ? 0 : 1));
      CHECK(joint.dynamics.damping == (i < 3 ? 0 : 1));
      CHECK(joint.effort_limit == (i < 3 ? 0 : 200));
    }
    CHECK(hopper.joints[3].lower == Approx(-150 * kPi / 180).epsilon(1e-15));
    CHECK(hopper.joints[4].upper == 0);
    CHECK(hopper.joints[5].upper == Approx(kPi / 4).epsilon(1e-15));
    CHECK(hopper.task.period == 0.008);
    CHECK(hopper.task.steps == 1000);
    REQUIRE(hopper.simulation.contact);
    REQUIRE(hopper.simulation.stop);
    CHECK(MakeTask(hopper)->observation_size() == 11);

    const double masses[] = {3.6652, 4.0579, 2.7814, 5.3156};
    for (size_t i = 0; i < 4; ++i) {
      const LinkDescription& link = hopper.links[i + 3];
      CHECK(link.mass == Approx(masses[i]).epsilon(2e-5));
      CHECK(link.collisions.size() == (link.name == "foot" ? 1 : 0));
      // Whatever is drawn weighs what it should: a capsule of water. Its caps are half spheres, whose own moments
      // across are 83/320 m r^2 about a centre 3/8 r outside the cylinder's end.
      REQUIRE(link.visuals.size() == 1);
      const Shape& shape = link.visuals[0];
      REQUIRE(shape.type == Shape::Type::kCapsule);
      const double r = shape.size[0], l = shape.size[1];
      const double cylinder = 1000 * kPi * r * r * l, caps = 1000 * 4.0 / 3 * kPi * r * r * r;
      const double along = cylinder * r * r / 2 + caps * 2 / 5 * r * r;
      const double across = cylinder * (l * l / 12 + r * r / 4) +
                            caps * (83.0 / 320 * r * r + std::pow(l / 2 + 3.0 / 8 * r, 2));
      CHECK(link.mass == Approx(cylinder + caps).epsilon(1e-14));
      CHECK((link.center_of_mass - shape.position).norm() < 1e-15);
      const Eigen::Matrix3d inertia =
          shape.rotation * Eigen::Vector3d(across, across, along).asDiagonal() * shape.rotation.transpose();
      CHECK((link.inertia - inertia).norm() < 1e-14);
    }
  }
  CHECK(LoadExample("hopper").parameters.size() == 4);
  CHECK(LoadExample("hopper/paper.toml").parameters[0].name == "mass/world");
}

TEST_CASE("the hopper pays for the way it makes") {
  const RobotDescription description = LoadExample("hopper");
  Environment environment(description);
  CHECK(environment.action_size() == 3);
  Eigen::VectorXd q = Eigen::VectorXd::Zero(6), v = q;
  q << 7, 3, 0, -0.1, -0.1, 0;  // in the air
  v[0] = 2;
  environment.SetState(q, v);
  const Environment::StepResult result = environment.Step(Eigen::Vector3f(0.5f, -3, 0));
  CHECK(result.reward == Approx((environment.q()[0] - 7) / 0.008 + 1 - 1e-3 * 1.25).epsilon(1e-9));
  CHECK(environment.effort() == (Eigen::VectorXd(6) << 0, 0, 0, 100, -200, 0).finished());
  CHECK_FALSE(result.terminated);
  q[1] = 0.5;
  environment.SetState(q, v);
  CHECK(environment.Step(Eigen::Vector3f::Zero()).terminated);
}

TEST_CASE("the other examples load, and their tasks fit") {
  const RobotDescription cartpole = LoadExample("cartpole"), arm = LoadExample("double_pendulum");
  CHECK(MakeTask(cartpole)->action_names() == std::vector<std::string>{"cart"});
  CHECK(MakeTask(arm)->action_size() == 2);
  CHECK(cartpole.warnings.empty());
  CHECK(arm.warnings.empty());
}

}  // namespace plumb
