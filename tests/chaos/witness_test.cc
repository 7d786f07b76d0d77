// The witnesses see what must not be: each violation once, and what is like it and right.

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>

#include "chaos/message_witness.h"
#include "chaos/torque_witness.h"
#include "common/lockstep/participant.h"
#include "common/message_bytes.h"
#include "drivers/protocols/cansimple.h"
#include "plumb/driver_request_t.hpp"
#include "plumb/driver_status_t.hpp"
#include "plumb/joint_command_t.hpp"
#include "plumb/joint_state_t.hpp"
#include "plumb/parameter_distribution_t.hpp"
#include "plumb/policy_t.hpp"
#include "plumb/robot_state_t.hpp"

namespace plumb {
namespace {

using namespace cansimple;

constexpr int64_t kMillisecond = 1000;

template <class Message>
lockstep_post_t Post(const std::string& channel, const Message& message, int64_t arrival) {
  lockstep_post_t post;
  post.topic = ChannelTopic(channel);
  post.arrival = arrival;
  post.data = Encode(message);
  post.size = static_cast<int32_t>(post.data.size());
  return post;
}

lockstep_post_t Post(const Frame& frame, int64_t arrival) {
  const std::string text = ToText(frame);
  lockstep_post_t post;
  post.topic = BusTopic("loop:");
  post.arrival = arrival;
  post.size = static_cast<int32_t>(text.size());
  post.data.assign(text.begin(), text.end());
  return post;
}

/// A pendulum's driver that is armed, commanded with 1 Nm, and has a drive that runs.
struct Armed {
  Armed() {
    witness.OnStart("plumb-driver");
    driver_status_t status{};
    status.state = driver_status_t::ARMED;
    witness.OnSaid(now, Post("DRIVER_STATUS", status, now), "plumb-driver");
    Request(driver_request_t::ARM);
    Command(1);
    DriverHears(Make(kGetEncoderEstimates, 1, {0, 0}));
    DriverHears(Make(kHeartbeat, 1, {0, kClosedLoopControl, 0, 0}));
    Pass(10);
  }
  void Pass(int64_t milliseconds) { now += milliseconds * kMillisecond; }
  void Command(double effort) {
    joint_command_t command{};
    command.utime = now;
    command.num_joints = 1;
    command.effort = {effort};
    command.position = command.velocity = command.kp = command.kd = {NAN};
    witness.OnHeard(Post("JOINT_COMMAND", command, now), "plumb-controller", "plumb-driver", true);
  }
  void Request(int8_t what) {
    driver_request_t request{};
    request.request = what;
    witness.OnHeard(Post("DRIVER_REQUEST", request, now), "", "plumb-driver", true);
  }
  void DriverHears(const Frame& frame) {
    witness.OnHeard(Post(frame, now), "plumb-robot", "plumb-driver", false);
  }
  /// The driver sends it. @return the invariant that is violated by now.
  int Torque(double torque) {
    witness.OnSaid(now, Post(Make(kSetInputTorqueShort, 1, {torque}), now), "plumb-driver");
    return chronicle.invariant();
  }

  const char* source = std::getenv("PLUMBLINE_SOURCE");
  RobotDescription robot = LoadRobot(std::string(source ? source : ".") + "/robots/pendulum");
  Chronicle chronicle;
  TorqueWitness witness{robot, chronicle};
  int64_t now = 1'000'000'000;
};

TEST_CASE("a torque has to be one that a fresh command wants, or less") {
  Armed armed;
  CHECK(armed.Torque(1) == 0);
  CHECK(armed.Torque(0.25) == 0);
  SECTION("more than that") { CHECK(armed.Torque(1.01) == 1); }
  SECTION("the other way") { CHECK(armed.Torque(-0.01) == 1); }
  SECTION("not finite") { CHECK(armed.Torque(NAN) == 1); }
  SECTION("beyond the limit") {
    armed.Command(1e6);
    CHECK(armed.Torque(2) == 0);
    CHECK(armed.Torque(2.01) == 1);
  }
  SECTION("when the command is old") {
    for (int i = 0; i < 20; ++i) {
      armed.Pass(5);
      armed.DriverHears(Make(kGetEncoderEstimates, 1, {0, 0}));
    }
    CHECK(armed.Torque(0) == 0);
    CHECK(armed.Torque(1) == 1);
  }
}

TEST_CASE("a torque has nothing against it") {
  Armed armed;
  SECTION("no estimates") {
    armed.Pass(40);
    CHECK(armed.Torque(1) == 0);
    armed.Pass(10);
    CHECK(armed.Torque(1) == 2);
  }
  SECTION("a drive that has stopped") {
    armed.DriverHears(Make(kHeartbeat, 1, {0, kIdle, 0, 0}));
    CHECK(armed.Torque(1) == 0);  // it need not have looked yet
    armed.Pass(5);
    CHECK(armed.Torque(1) == 2);
  }
  SECTION("a request to stop, until one to arm") {
    armed.Request(driver_request_t::DISARM);
    armed.Pass(5);
    armed.Request(driver_request_t::ARM);
    CHECK(armed.Torque(1) == 0);
    armed.Pass(1);
    armed.Request(driver_request_t::ESTOP);
    armed.Pass(5);
    CHECK(armed.Torque(1) == 2);
  }
  SECTION("a second master") {
    armed.DriverHears(Make(kSetInputTorque, 1, {0}));
    armed.Pass(5);
    CHECK(armed.Torque(1) == 2);
  }
  SECTION("a driver that stops and tells nobody") {
    const auto say = [&](AxisState state) {
      const Frame frame = Make(kSetAxisState, 1, {static_cast<double>(state)});
      armed.witness.OnSaid(armed.now, Post(frame, armed.now), "plumb-driver");
    };
    driver_status_t status{};
    status.state = driver_status_t::FAULT;
    const auto stop = [&] {
      armed.witness.OnSaid(armed.now, Post("DRIVER_STATUS", status, armed.now), "plumb-driver");
    };
    say(kClosedLoopControl);
    say(kIdle);
    stop();
    CHECK_FALSE(armed.chronicle.violated());
    say(kClosedLoopControl);
    stop();
    CHECK(armed.chronicle.invariant() == 2);
  }
  SECTION("what it says itself") {
    driver_status_t status{};
    status.state = driver_status_t::FAULT;
    armed.witness.OnSaid(armed.now, Post("DRIVER_STATUS", status, armed.now), "plumb-driver");
    CHECK(armed.Torque(0) == 0);
    CHECK(armed.Torque(1) == 2);
  }
}

TEST_CASE("a drive does not run without the driver for longer than its watchdog") {
  Armed armed;
  const auto beat = [&] {
    const Frame frame = Make(kHeartbeat, 1, {0, kClosedLoopControl, 0, 0});
    armed.witness.OnSaid(armed.now, Post(frame, armed.now), "plumb-robot");
    return armed.chronicle.invariant();
  };
  armed.witness.OnHeard(Post(Make(kSetInputTorqueShort, 1, {0}), armed.now), "plumb-driver",
                        "plumb-robot", false);
  armed.Pass(100);
  CHECK(beat() == 0);
  armed.Pass(10);
  CHECK(beat() == 2);
  CHECK_THAT(armed.chronicle.Story(), Catch::Contains("pivot"));
}

TEST_CASE("what is valid is finite, and iterations do not count down") {
  Chronicle chronicle;
  MessageWitness witness(chronicle);
  robot_state_t state{};
  state.num_positions = state.num_velocities = 1;
  state.q = state.v = state.q_sd = state.v_sd = state.effort = {0};
  state.q = {NAN};
  policy_t policy{};
  policy.iteration = 1;
  witness.OnSaid(1, Post("ROBOT_STATE", state, 1), "plumb-estimator");
  witness.OnSaid(1, Post("POLICY", policy, 1), "plumb-trainer");
  witness.OnSaid(2, Post("POLICY", policy, 2), "plumb-trainer");
  CHECK_FALSE(chronicle.violated());
  SECTION("not finite") {
    state.valid = true;
    witness.OnSaid(3, Post("ROBOT_STATE", state, 3), "plumb-estimator");
    CHECK(chronicle.invariant() == 3);
  }
  SECTION("an effort may be unknown, and not infinite") {
    state.valid = true;
    state.q = {0}, state.effort = {NAN};
    witness.OnSaid(3, Post("ROBOT_STATE", state, 3), "plumb-estimator");
    CHECK_FALSE(chronicle.violated());
    state.effort = {INFINITY};
    witness.OnSaid(4, Post("ROBOT_STATE", state, 4), "plumb-estimator");
    CHECK(chronicle.invariant() == 3);
  }
  SECTION("of a joint that is not valid nothing is demanded") {
    joint_state_t joints{};
    joints.num_joints = 2;
    joints.measured = {0, 0};
    joints.position = {0, NAN}, joints.velocity = {NAN, INFINITY};
    joints.effort_measured = joints.effort_sent = joints.effort_applied = {NAN, NAN};
    joints.valid = {1, 0};
    witness.OnSaid(3, Post("JOINT_STATE", joints, 3), "plumb-driver");
    CHECK_FALSE(chronicle.violated());
    joints.effort_applied[0] = -INFINITY;
    witness.OnSaid(4, Post("JOINT_STATE", joints, 4), "plumb-driver");
    CHECK(chronicle.invariant() == 3);
  }
  SECTION("a policy's normalisation, a distribution's starts") {
    const bool of_policy = GENERATE(true, false);
    if (of_policy) {
      policy.num_observations = 1;
      policy.observation_mean = {0}, policy.observation_scale = {NAN};
      witness.OnSaid(3, Post("POLICY", policy, 3), "plumb-trainer");
    } else {
      parameter_distribution_t distribution{};
      distribution.num_starts = 1;
      distribution.start = {NAN};
      witness.OnSaid(3, Post("PARAMETER_DISTRIBUTION", distribution, 3), "plumb-calibrator");
    }
    CHECK(chronicle.invariant() == 3);
  }
  SECTION("counted back") {
    policy.iteration = 0;
    witness.OnSaid(3, Post("POLICY", policy, 3), "");  // a forger may
    CHECK_FALSE(chronicle.violated());
    witness.OnSaid(3, Post("POLICY", policy, 3), "plumb-trainer");
    CHECK(chronicle.invariant() == 6);
  }
}

}  // namespace
}  // namespace plumb
