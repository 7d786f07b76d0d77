// Impacts are not white jerk. Independent truth: joints that bounce off a stop made of a spring and
// a damper, by its exact solution.

#include "estimator/impact.h"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <unsupported/Eigen/MatrixFunctions>
#include <vector>

#include "common/random.h"
#include "estimator/noise_tuning.h"
#include "estimator/state_observer.h"

namespace plumb {
namespace {

constexpr double kPositionSd = 1e-4, kVelocitySd = 0.1, kStopImpact = 100;
constexpr int64_t kImpactPeriod = 2000, kSubstep = 20;  // [us]

/// Falls onto its stop at zero, again and again.
RobotDescription Hammer() {
  RobotDescription robot{};
  robot.joints.resize(1);
  robot.joints[0].name = "pivot";
  robot.joints[0].upper = 10;
  robot.joints[0].effort_limit = 2;
  robot.estimator = {.position_sd = kPositionSd,
                     .velocity_sd = kVelocitySd,
                     .jerk = 1,
                     .effort_step = 0,
                     .timing_sd = 0,
                     .lag = 10,
                     .reset_after = 0.2};
  return robot;
}

struct Bounce {
  std::vector<joint_state_t> measured;
  std::vector<Eigen::Vector2d> truth;  // position, velocity
  std::vector<bool> impact;            // within 10 ms of its beginning
};

Bounce Bouncing(uint32_t seed) {
  Random random(seed, {51});
  constexpr double kGravity = 10;
  const double damping = random.Uniform(50, 150), stiffness = random.Uniform(1000, 5000);
  const double h = 1e-6 * kSubstep;
  Eigen::Matrix3d pressed;  // of position, velocity, gravity
  pressed << 0, 1, 0, -stiffness, -damping, -1, 0, 0, 0;
  const Eigen::Matrix3d in_stop = (h * pressed).exp();
  Eigen::Vector3d x(random.Uniform(0.05, 0.3), random.Uniform(-2, 0), kGravity);
  Bounce bounce;
  int64_t last = -1'000'000;  // [us] when an impact began
  for (int64_t t = 0; t < 1'000'000 && (last < 0 || t - last < 200'000); t += kSubstep) {
    if (t % kImpactPeriod == 0) {
      const auto k = static_cast<int64_t>(bounce.truth.size());
      joint_state_t m{};
      m.utime = 1'000'000 + t;
      m.sequence = k;
      m.num_joints = 1;
      m.measured = {m.utime};
      m.position = {x(0) + kPositionSd * random.Normal()};
      m.velocity = {x(1) + kVelocitySd * random.Normal()};
      m.effort_measured = m.effort_sent = m.effort_applied = {0.0};
      m.valid = {1};
      bounce.measured.push_back(m);
      bounce.truth.push_back(x.head<2>());
      bounce.impact.push_back(t - last < 10'000);
    }
    const bool above = x(0) >= 0;
    if (!above && stiffness * x(0) + damping * x(1) < 0) {
      x = in_stop * x;
    } else {
      x(0) += h * x(1) - h * h * kGravity / 2;
      x(1) -= h * kGravity;
    }
    if (above && x(0) < 0) last = t;
  }
  return bounce;
}

/// Average normalised squared error of smoothed velocities, at impacts and elsewhere.
struct NeesNearImpacts {
  double impact = 0, free = 0;
};
NeesNearImpacts NeesOf(const RobotDescription& robot) {
  double sum[2] = {0, 0}, count[2] = {0, 0};
  for (uint32_t seed = 1; seed <= 40; ++seed) {
    const Bounce bounce = Bouncing(seed);
    StateObserver observer(robot);
    size_t next = 0;
    for (const joint_state_t& m : bounce.measured) {
      observer.OnJointState(m);
      for (const robot_state_t& state : observer.smoothed()) {
        const double error = (state.v[0] - bounce.truth[next](1)) / state.v_sd[0];
        if (state.valid) sum[bounce.impact[next]] += error * error, ++count[bounce.impact[next]];
        ++next;
      }
    }
  }
  REQUIRE(count[1] > 200);
  return {sum[1] / count[1], sum[0] / count[0]};
}

TEST_CASE(
    "where a joint meets its stop the velocity's error is as large as it says, with the impact "
    "left open") {
  RobotDescription robot = Hammer();
  const NeesNearImpacts without = NeesOf(robot);
  robot.estimator.stop_impact = kStopImpact;
  const NeesNearImpacts with = NeesOf(robot);
  INFO("at impacts " << without.impact << " and " << with.impact << ", elsewhere " << without.free
                     << " and " << with.free);
  CHECK(without.impact > 20);
  CHECK(with.impact > 0.5);
  CHECK(with.impact < 1.5);
  CHECK(with.free < 1.5);
}

TEST_CASE("how hard stops are is learnt, and that there are none") {
  RobotDescription robot = Hammer();
  robot.estimator.jerk = 300;
  std::vector<joint_state_t> readings;
  for (uint32_t seed = 101; seed <= 112; ++seed) {
    for (joint_state_t m : Bouncing(seed).measured) {
      m.utime += 10'000'000 * int64_t{seed};
      m.measured = {m.utime};
      readings.push_back(m);
    }
  }
  const auto play = [&](StateObserver& observer) {
    for (const joint_state_t& m : readings) observer.OnJointState(m);
  };
  const TunedNoise tuned = TuneNoise(robot, play);
  CHECK(tuned.joints[0].stop_impact > 30);
  CHECK(tuned.joints[0].stop_impact < 300);
  CHECK(tuned.joints[0].jerk < 30);
  CHECK(tuned.joints[0].ground_impact == 0);
  CHECK(tuned.after[0] < tuned.before[0] - 0.5);
  robot.joints[0].lower = -10;  // it bounces off something else
  CHECK(TuneNoise(robot, play).joints[0].stop_impact == 0);
}

TEST_CASE("a speed counts from shortly before the impact until it rests") {
  constexpr double kAhead = 2e-3;
  CHECK(StopSpeed(-1, 1, 0.9, 5, kAhead) == 0);
  CHECK(StopSpeed(-1, 1, 0.982, 5, kAhead) == 5);
  CHECK(StopSpeed(-1, 1, 1.01, -5, kAhead) == 5);
  CHECK(StopSpeed(-1, 1, -0.982, -5, kAhead) == 5);
  CHECK(StopSpeed(-1, 1, -0.982, 5, kAhead) == 0);
  CHECK(StopSpeed(-1, 1, -1.01, 0, kAhead) == 0);
  CHECK(StopSpeed(0, 0, 0, 5, kAhead) == 0);
  const double infinity = std::numeric_limits<double>::infinity();
  CHECK(StopSpeed(-infinity, infinity, 0, 5, kAhead) == 0);
}

// Two joints, one of which an effort acts upon, or its stop.
std::vector<double> VelocitySds(double coupling, bool effort, bool stop) {
  RobotDescription robot{};
  robot.joints.resize(2);
  for (JointDescription& joint : robot.joints)
    joint.effort_limit = 2, joint.lower = -1, joint.upper = 1;
  robot.estimator = {.position_sd = 1e-4,
                     .velocity_sd = 0.5,
                     .jerk = 1,
                     .effort_step = 30,
                     .stop_impact = 100,
                     .coupling = coupling,
                     .timing_sd = 0,
                     .lag = 4,
                     .reset_after = 10};
  StateObserver observer(robot);
  joint_state_t m{};
  m.num_joints = 2;
  m.position = m.velocity = m.effort_measured = m.effort_sent = m.effort_applied = {0, 0};
  m.valid = {1, 1};
  for (int k = 0; k <= 100; ++k) {
    m.utime = 1'000'000 + 2000 * k;
    m.sequence = k;
    m.measured = {m.utime, m.utime};
    m.velocity[0] = stop ? 3 : 0;
    m.position[0] = stop ? 1.0 - 3 * 2e-3 * (100 - k) : 0.0;
    m.effort_applied[0] = effort && k == 100 ? 1 : 0;
    observer.OnJointState(m);
  }
  return observer.state().v_sd;
}

TEST_CASE("what acts on one joint is felt by others by their coupling") {
  const std::vector<double> rest = VelocitySds(1, false, false);
  for (const bool stop : {false, true}) {
    const auto at = [&](double coupling) { return VelocitySds(coupling, !stop, stop); };
    CHECK(at(0)[0] > 1.05 * rest[0]);
    CHECK(at(0)[0] == Approx(at(1)[0]).epsilon(1e-9));
    CHECK(at(0)[1] == Approx(rest[1]).epsilon(1e-9));
    CHECK(at(0.5)[1] > at(0)[1]);
    CHECK(at(1)[1] > at(0.5)[1]);
  }
}

}  // namespace
}  // namespace plumb
