// The observer under silence, disorder and lies.

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "common/random.h"
#include "estimator/state_observer.h"

namespace plumb {
namespace {

constexpr int64_t kPeriod = 5000;  // [us]

RobotDescription RobotOf(int joints) {
  RobotDescription robot{};
  robot.joints.resize(static_cast<size_t>(joints));
  for (JointDescription& joint : robot.joints) joint.effort_limit = 2;
  robot.joints[0].name = "first";
  robot.estimator = {.position_sd = 1.2e-4,
                     .velocity_sd = 0.1,
                     .jerk = 100,
                     .effort_step = 30,
                     .timing_sd = 0,
                     .lag = 4,
                     .reset_after = 0.2};
  return robot;
}

double Position(double t) { return std::sin(3 * t); }
double Velocity(double t) { return 3 * std::cos(3 * t); }

/// Joints that all move like this, with noise as assumed.
struct SteadyMotion {
  explicit SteadyMotion(int joints) : observer(RobotOf(joints)), n(static_cast<size_t>(joints)) {}

  joint_state_t Next() {
    joint_state_t m{};
    ++sequence;
    m.utime = 1'000'000 + kPeriod * sequence;
    m.sequence = sequence;
    m.num_joints = static_cast<int32_t>(n);
    m.measured.assign(n, m.utime);
    m.effort_measured = m.effort_sent = m.effort_applied = std::vector<double>(n, 0.0);
    m.valid.assign(n, 1);
    for (size_t i = 0; i < n; ++i) {
      m.position.push_back(Position(time()) + 1.2e-4 * random.Normal());
      m.velocity.push_back(Velocity(time()) + 0.1 * random.Normal());
    }
    return m;
  }
  double time() const { return 1e-6 * kPeriod * static_cast<double>(sequence); }
  void Run(int count) {
    for (int i = 0; i < count; ++i) REQUIRE(observer.OnJointState(Next()));
  }

  StateObserver observer;
  size_t n;
  int64_t sequence = 0;
  Random random{5, {1}};
};

TEST_CASE(
    "a silent joint is predicted with growing uncertainty, then the state is invalid, then it is "
    "back") {
  SteadyMotion motion(2);
  motion.Run(100);
  CHECK(motion.observer.state().valid);
  const bool flagged = GENERATE(true, false);  // or its reading is only not new
  const joint_state_t last = motion.Next();
  REQUIRE(motion.observer.OnJointState(last));
  double sd = motion.observer.state().q_sd[0];
  for (int i = 1; i <= 100; ++i) {
    joint_state_t m = motion.Next();
    m.measured[0] = last.measured[0];
    m.position[0] = flagged ? NAN : last.position[0];
    m.valid[0] = !flagged;
    REQUIRE(motion.observer.OnJointState(m));
    const robot_state_t& state = motion.observer.state();
    INFO(i);
    CHECK_FALSE(state.restarted);
    CHECK(state.valid == (i <= 10));  // 50 ms
    CHECK(state.q_sd[0] > sd);
    CHECK(state.q_sd[1] < 2e-4);
    sd = state.q_sd[0];
    if (i <= 10) CHECK(std::abs(state.q[0] - Position(motion.time())) < 4 * sd);
  }
  CHECK(motion.observer.Status().reason == "first: no reading for 0.50 s");
  CHECK(motion.observer.Status().outages == 1);
  motion.Run(1);
  CHECK(motion.observer.state().restarted);
  CHECK(motion.observer.state().q[0] == Approx(Position(motion.time())).margin(1e-3));
  motion.Run(5);
  CHECK(motion.observer.state().valid);
  CHECK(motion.observer.Status().reason.empty());
  motion.Run(50);
  CHECK(motion.observer.state().v[0] == Approx(Velocity(motion.time())).margin(0.15));
}

TEST_CASE("a short silence ends without a restart") {
  SteadyMotion motion(1);
  motion.Run(100);
  for (int i = 0; i < 8; ++i) {
    joint_state_t m = motion.Next();
    m.valid[0] = 0;
    motion.observer.OnJointState(m);
  }
  motion.Run(1);
  CHECK_FALSE(motion.observer.state().restarted);
  CHECK(motion.observer.state().valid);
  CHECK(motion.observer.Status().outages == 0);
}

TEST_CASE("silent for longer than a second, and from the very start") {
  SteadyMotion motion(2);
  for (int i = 0; i < 300; ++i) {
    joint_state_t m = motion.Next();
    m.measured[0] = 0;
    m.position[0] = 0;
    m.valid[0] = 0;
    REQUIRE(motion.observer.OnJointState(m));
    CHECK_FALSE(motion.observer.state().valid);
  }
  CHECK(motion.observer.Status().reason == "first: no reading yet");
  motion.Run(6);
  CHECK(motion.observer.state().valid);
  CHECK(motion.observer.restarts() == 1);
}

TEST_CASE("duplicates and late messages are counted and change nothing") {
  SteadyMotion motion(1), undisturbed(1);
  motion.Run(10);
  undisturbed.Run(10);
  const joint_state_t older = motion.Next(), newer = motion.Next();
  undisturbed.Next();
  REQUIRE(motion.observer.OnJointState(newer));
  CHECK_FALSE(motion.observer.OnJointState(newer));
  CHECK_FALSE(motion.observer.OnJointState(older));
  REQUIRE(undisturbed.observer.OnJointState(undisturbed.Next()));
  motion.Run(1);
  undisturbed.Run(1);
  CHECK(motion.observer.state().q[0] == undisturbed.observer.state().q[0]);
  CHECK(motion.observer.state().v[0] == undisturbed.observer.state().v[0]);
  const estimator_status_t status = motion.observer.Status();
  CHECK(status.duplicates == 1);
  CHECK(status.reordered == 1);
  CHECK(status.restarts == 0);
  CHECK(motion.observer.unused() == 2);
}

TEST_CASE("noise as assumed: innovations are normal, and nobody lies") {
  SteadyMotion motion(1);
  motion.Run(2000);
  const estimator_status_t status = motion.observer.Status();
  CHECK(status.position_nis[0] == Approx(1).margin(0.5));
  CHECK(status.velocity_nis[0] == Approx(1).margin(0.5));
  CHECK(std::isnan(status.acceleration_nis[0]));
  CHECK(status.joint_reason[0].empty());
  CHECK(status.age[0] == 0);
}

TEST_CASE("a lying sensor is named") {
  SteadyMotion motion(1);
  motion.Run(200);
  const int64_t before = motion.observer.reasons_changed();
  std::string expected;
  double stuck = NAN;
  const int lie = GENERATE(0, 1, 2, 3);
  bool seen = false;
  for (int i = 0; i < 150; ++i) {
    joint_state_t m = motion.Next();
    // drifts by 0.8 rad/s
    if (lie == 0) m.position[0] += 0.004 * i, expected = "position and velocity disagree";
    if (lie == 1) m.position[0] += 0.19, expected = "position jumped by 0.1";
    if (lie == 2)
      m.position[0] = stuck = std::isnan(stuck) ? m.position[0] : stuck,
      expected = "position stuck at";
    if (lie == 3)
      m.velocity[0] = stuck = std::isnan(stuck) ? m.velocity[0] : stuck,
      expected = "velocity stuck";
    REQUIRE(motion.observer.OnJointState(m));
    seen = seen || motion.observer.Status().joint_reason[0].find(expected) == 0;
  }
  INFO(expected << ": " << motion.observer.Status().joint_reason[0]);
  CHECK(seen);
  CHECK(motion.observer.reasons_changed() > before);
  motion.Run(200);  // the truth again
  CHECK(motion.observer.Status().joint_reason[0].empty());
}

}  // namespace
}  // namespace plumb
