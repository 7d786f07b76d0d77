#pragma once

#include <catch2/catch.hpp>
#include <cstdlib>
#include <optional>
#include <string>

#include "controller/controller.h"

namespace plumb {

/// The world around a controller, in steps of one measurement (5 ms).
class Surroundings {
 public:
  explicit Surroundings(const std::string& folder = "robots/pendulum")
      : robot(LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/" + folder)),
        controller(robot, 1) {
    robot_state.num_positions = robot.num_positions();
    robot_state.num_velocities = robot.num_velocities();
    robot_state.q.assign(static_cast<size_t>(robot.num_positions()), 0);
    for (auto* values : {&robot_state.v, &robot_state.q_sd, &robot_state.v_sd, &robot_state.effort})
      values->assign(static_cast<size_t>(robot.num_velocities()), 0);
    robot_state.valid = 1;
  }

  void Driver(int8_t state) {
    driver_status_t status{};
    status.state = state;
    controller.OnDriverStatus(status, now);
  }

  policy_t Policy(int iteration, int episodes = 1, float bias = 0,
                  int8_t purpose = policy_t::EVALUATE) {
    const auto task = MakeTask(robot);
    const int actions = task->action_size();
    GaussianPolicy policy(PolicyShape{task->observation_size(), {4}, actions});
    policy.parameters(policy.parameters.size() - 1 - actions) = bias;  // of the last output
    policy.action_scale = robot.effort_limits().cast<float>();
    policy_t message = policy.ToMessage();
    message.utime = 1000 + iteration;
    message.iteration = iteration;
    message.episodes = episodes;
    message.purpose = purpose;
    return message;
  }

  /// One measurement; the robot is wherever it was last asked to be placed. @return the command, if
  /// any.
  std::optional<joint_command_t> Step() {
    now += 5000, utime += 5000;
    ++robot_state.sequence;
    robot_state.utime = utime;
    if (controller.place())
      robot_state.q = controller.place()->q, robot_state.v = controller.place()->v;
    auto command = controller.OnState(robot_state, now, utime + 300);
    const auto halt = controller.Tick(now, utime);
    if (halt) command = halt;
    if (controller.phase() != 4 && now % 100'000 == 0) Driver(driver_state);
    return command;
  }
  void StepUntil(int8_t phase, int most = 10000) {
    for (int i = 0; i < most && controller.phase() != phase; ++i) Step();
    REQUIRE(controller.phase() == phase);
  }

  RobotDescription robot;
  Controller controller;
  robot_state_t robot_state{};
  int64_t now = 1'000'000, utime = 50'000'000;
  int8_t driver_state = driver_status_t::ARMED;
};

using S = controller_status_t;

}  // namespace plumb
