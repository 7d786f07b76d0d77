// The robots that come with the house.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "sim/environment.h"
#include "sim/tasks/task.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

RobotDescription LoadExample(const std::string& name) {
  return LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/" + name);
}

using Names = std::vector<std::string>;

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
    CHECK(hopper.joints[3].lower == Approx(-150 * std::numbers::pi / 180).epsilon(1e-15));
    CHECK(hopper.joints[4].upper == 0);
    CHECK(hopper.joints[5].upper == Approx(std::numbers::pi / 4).epsilon(1e-15));
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
      // Whatever is drawn weighs what it should: a capsule of water. Its caps are half spheres,
      // whose own moments across are 83/320 m r^2 about a centre 3/8 r outside the cylinder's end.
      REQUIRE(link.visuals.size() == 1);
      const Shape& shape = link.visuals[0];
      REQUIRE(shape.type == Shape::Type::kCapsule);
      const double r = shape.size[0], l = shape.size[1];
      const double cylinder = 1000 * std::numbers::pi * r * r * l,
                   caps = 1000 * 4.0 / 3 * std::numbers::pi * r * r * r;
      const double along = cylinder * r * r / 2 + caps * 2 / 5 * r * r;
      const double across = cylinder * (l * l / 12 + r * r / 4) +
                            caps * (83.0 / 320 * r * r + std::pow(l / 2 + 3.0 / 8 * r, 2));
      CHECK(link.mass == Approx(cylinder + caps).epsilon(1e-14));
      CHECK((link.center_of_mass - shape.position).norm() < 1e-15);
      const Eigen::Matrix3d inertia = shape.rotation *
                                      Eigen::Vector3d(across, across, along).asDiagonal() *
                                      shape.rotation.transpose();
      CHECK((link.inertia - inertia).norm() < 1e-14);
    }
  }
  CHECK(LoadExample("hopper").parameters.size() == 4);
  CHECK(LoadExample("hopper/paper.toml").parameters[4].name == "mass/world");
}

TEST_CASE("the hopper pays for the way it makes") {
  const RobotDescription description = LoadExample("hopper");
  Environment environment(description);
  CHECK(environment.action_size() == 3);
  Eigen::VectorXd q = Eigen::VectorXd::Zero(6), v = q;
  q << 7, 3, 0, -0.1, -0.1, 0;  // in the air
  v[0] = 2;
  environment.SetState(q, v);
  const StepResult result = environment.Step(Eigen::Vector3f(0.5f, -3, 0));
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

TEST_CASE("every observation has a name of its own, with its unit") {
  const auto names = [](const std::string& robot) {
    return MakeTask(LoadExample(robot))->observation_names();
  };
  CHECK(names("pendulum") == Names{"cos(q/pivot)", "sin(q/pivot)", "v/pivot [rad/s]"});
  CHECK(names("cartpole") ==
        Names{"e/cart [m]", "sin(e/hinge)", "cos(e/hinge)", "v/cart [m/s]", "v/hinge [rad/s]"});
  CHECK(names("hopper") == Names{"q/rootz [m]", "q/rooty [rad]", "q/thigh [rad]", "q/leg [rad]",
                                 "q/foot [rad]", "v/rootx [m/s]", "v/rootz [m/s]",
                                 "v/rooty [rad/s]", "v/thigh [rad/s]", "v/leg [rad/s]",
                                 "v/foot [rad/s]"});
  int files = 0;
  for (const auto& entry :
       fs::recursive_directory_iterator(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots")) {
    if (entry.path().extension() != ".toml") continue;
    ++files;
    INFO(entry.path());
    const RobotDescription robot = LoadRobot(entry.path().string());
    const auto task = MakeTask(robot);
    const size_t size = task->observation_names().size();
    CHECK(static_cast<int>(size) == task->observation_size());
    CHECK(std::set<std::string>(task->observation_names().begin(), task->observation_names().end())
              .size() == size);
    // As many are written, and no more.
    std::vector<float> observation(size + 1, NAN);
    Random random(1);
    Eigen::VectorXd q(robot.num_positions()), v(robot.num_velocities());
    task->InitialState(random, q, v);
    task->Observe(q, v, {observation.data(), size});
    CHECK(std::count_if(observation.begin(), observation.end(),
                        [](float x) { return std::isnan(x); }) == 1);
    CHECK(std::isnan(observation.back()));
  }
  CHECK(files >= 4);
}

}  // namespace plumb
