// A simulated quadruped that nothing holds: what its IMU and its legs tell of its trunk.

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/estimator/allocations_of.h"
#include "tests/estimator/observer_errors.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr size_t kQ = 19, kV = 18;

RobotDescription Quadruped() {
  RobotDescription robot = WithSimulatedNoise(LoadRobot(SourceFile("robots/quadruped")));
  robot.driver.measurement = 1e-6 * SimulatedReadings::kPeriod;
  return robot;
}

Eigen::VectorXd Standing(const RobotDescription& robot, double heading) {
  Eigen::VectorXd q(kQ);
  q << 0, 0, 0.3, std::cos(heading / 2), 0, 0, std::sin(heading / 2), Eigen::VectorXd::Zero(12);
  for (Eigen::Index i = 0; i < 12; ++i)
    q[7 + i] = robot.joints[4 + static_cast<size_t>(i)].dynamics.rest;
  return q;
}

/// Stands for half a second, then trots on the spot: diagonal legs bend in turn. 3 s.
std::vector<SimulatedReadings::Sample> Trot(const RobotDescription& robot, uint32_t seed,
                                            double lift = 0.35) {
  Random random(seed, {45});
  const Eigen::VectorXd q = Standing(robot, random.Uniform(-3, 3));
  const double frequency = random.Uniform(1.5, 2.2);
  return SimulatedReadings(robot, seed)
      .Run(q, Eigen::VectorXd::Zero(kV), 3, 20'000, [=](double t, const auto&, const auto&) {
        Eigen::VectorXd effort = Eigen::VectorXd::Zero(12);
        if (t < 0.5) return effort;
        const double phase = 2 * std::numbers::pi * frequency * (t - 0.5);
        for (int leg = 0; leg < 4; ++leg) {
          const bool first = leg == 0 || leg == 3;  // front left and rear right
          const double bend = lift * std::max(0.0, first ? std::sin(phase) : -std::sin(phase));
          effort[3 * leg + 1] = 25 * 0.45 * bend;
          effort[3 * leg + 2] = -25 * 0.9 * bend;
        }
        return effort;
      });
}

struct TrunkErrors {
  StateErrors height, lean, velocity, rate;
  double valid = 0, count = 0;
  int64_t restarts = 0;
};

TrunkErrors TrunkErrorsOf(const RobotDescription& robot, const Recordings& recordings,
                          bool smoothed) {
  TrunkErrors errors;
  for (const auto& recording : recordings) {
    StateObserver observer(robot);
    const auto compare = [&](const robot_state_t& state) {
      const SimulatedReadings::Sample& truth = recording[static_cast<size_t>(state.sequence - 1)];
      ++errors.count;
      if (!state.valid) return;
      ++errors.valid;
      const auto at = [&](const Eigen::VectorXd& q) { return Quaterniond(q[3], q[4], q[5], q[6]); };
      const Quaterniond turn = at(Eigen::VectorXd::Map(state.q.data(), kQ)), real = at(truth.q);
      errors.height.Add(state.q[2] - truth.q[2], 0, state.q_sd[2], 1);
      const Vector3d up = turn.conjugate() * Vector3d::UnitZ(),
                     real_up = real.conjugate() * Vector3d::UnitZ();
      const Vector3d lean = real_up.cross(up);
      // As it is in the trunk's heading: nobody knows the world's.
      const Vector3d velocity = turn.conjugate() * Vector3d(state.v[0], state.v[1], state.v[2]) -
                                real.conjugate() * Vector3d(truth.v.head<3>());
      for (Eigen::Index i = 0; i < 3; ++i) {
        const auto k = static_cast<size_t>(i);
        if (i < 2) errors.lean.Add(lean[i], 0, state.q_sd[3 + k], 1);
        errors.velocity.Add(0, velocity[i], 1, state.v_sd[k]);
        errors.rate.Add(0, state.v[3 + k] - truth.v[3 + i], 1, state.v_sd[3 + k]);
      }
    };
    for (const SimulatedReadings::Sample& sample : recording) {
      for (const imu_t& imu : sample.imus) observer.OnImu(imu);
      REQUIRE(observer.OnJointState(sample.joints));
      if (!smoothed) compare(observer.state());
      if (!smoothed) continue;
      for (const robot_state_t& state : observer.smoothed()) compare(state);
    }
    errors.restarts += observer.restarts();
  }
  return errors;
}

std::string DescribeTrunk(const TrunkErrors& e) {
  return "height " + std::to_string(e.height.q()) + " NEES " + std::to_string(e.height.nees_q()) +
         ", lean " + std::to_string(e.lean.q()) + " NEES " + std::to_string(e.lean.nees_q()) +
         ", velocity " + std::to_string(e.velocity.v()) + " NEES " +
         std::to_string(e.velocity.nees_v()) + ", rate " + std::to_string(e.rate.v()) + " NEES " +
         std::to_string(e.rate.nees_v()) + ", valid " + std::to_string(e.valid / e.count) +
         ", restarts " + std::to_string(e.restarts);
}

TEST_CASE("a quadruped knows its height, lean and velocities") {
  const RobotDescription robot = Quadruped();
  Recordings recordings;
  for (uint32_t seed = 1; seed <= 4; ++seed) recordings.push_back(Trot(robot, seed));
  for (const bool smoothed : {false, true}) {
    const TrunkErrors e = TrunkErrorsOf(robot, recordings, smoothed);
    INFO((smoothed ? "smoothed: " : "causal: ") << DescribeTrunk(e));
    CHECK(e.restarts == 0);
    CHECK(e.valid > 0.95 * e.count);
    CHECK(e.height.q() < 0.01);
    CHECK(e.height.nees_q() < 2);
    CHECK(e.lean.q() < 0.01);
    CHECK(e.lean.nees_q() < 2);
    // Feet slide, 0.16 m/s root mean square, as long as they stand: no random walk.
    CHECK(e.velocity.v() < 0.05);
    CHECK(e.velocity.nees_v() < 4);
    CHECK(e.rate.nees_v() < 2);
  }
}

TEST_CASE("a quadruped that stands is as high as the ground that its feet press in lets it be") {
  const RobotDescription robot = Quadruped();
  const auto recording = Trot(robot, 5, 0);
  StateObserver observer(robot);
  double error = 0;
  int count = 0;
  for (size_t k = 0; k < recording.size(); ++k) {
    for (const imu_t& imu : recording[k].imus) observer.OnImu(imu);
    observer.OnJointState(recording[k].joints);
    if (k < recording.size() / 2) continue;
    REQUIRE(observer.state().valid);
    error += observer.state().q[2] - recording[k].q[2];
    ++count;
  }
  INFO("mean error of the height: " << error / count << " m");
  CHECK(std::abs(error / count) < 3e-4);  // it has sunk in by 1.5 mm
}

TEST_CASE("where it is along the ground and which way it heads grow unsure, no quaternion does") {
  const RobotDescription robot = Quadruped();
  const auto recording = Trot(robot, 7, 0.5);
  StateObserver observer(robot);
  std::vector<double> early;
  for (size_t k = 0; k < recording.size(); ++k) {
    for (const imu_t& imu : recording[k].imus) observer.OnImu(imu);
    observer.OnJointState(recording[k].joints);
    const robot_state_t& state = observer.state();
    if (k == 200) early = state.q_sd;
    if (!state.valid) continue;
    REQUIRE(state.q.size() == kQ);
    REQUIRE(state.v.size() == kV);
    REQUIRE(state.q_sd.size() == kV);
    REQUIRE(state.v_sd.size() == kV);
    REQUIRE(state.effort.size() == kV);
    CHECK(std::abs(Eigen::Vector4d::Map(&state.q[3]).norm() - 1) < 1e-12);
  }
  REQUIRE(observer.state().valid);
  const auto& late = observer.state().q_sd;
  CHECK(late[0] > 1.5 * early[0]);
  CHECK(late[1] > 1.5 * early[1]);
  CHECK(late[2] < 1.5 * early[2]);
  CHECK(late[5] > 1.2 * early[5]);
  CHECK(late[3] < 0.03);  // a little of the heading is in it where the trunk leans
}

TEST_CASE("fallen and put on its feet again, it notices, although no joint has moved") {
  const RobotDescription robot = Quadruped();
  const auto recording = Trot(robot, 8, 0);
  StateObserver observer(robot);
  int64_t restarted_at = -1;
  const Quaterniond fallen(Eigen::AngleAxisd(1.5, Vector3d::UnitX()));
  for (size_t k = 0; k < 700; ++k) {
    for (imu_t imu : recording[k].imus) {
      // It lies on its side from 300 on until somebody puts it up again; the gyro feels neither.
      if (k >= 300 && k < 500) {
        const Quaterniond told = fallen * Quaterniond(imu.orientation[0], imu.orientation[1],
                                                      imu.orientation[2], imu.orientation[3]);
        imu.orientation[0] = told.w(), imu.orientation[1] = told.x(), imu.orientation[2] = told.y(),
        imu.orientation[3] = told.z();
        const Vector3d force = fallen.conjugate() * Vector3d::Map(imu.force);
        std::copy_n(force.data(), 3, std::begin(imu.force));
      }
      observer.OnImu(imu);
    }
    observer.OnJointState(recording[k].joints);
    if (observer.state().restarted && k > 0) restarted_at = static_cast<int64_t>(k);
    if (k == 299) REQUIRE(observer.state().valid);
  }
  CHECK(restarted_at >= 500);
  CHECK(restarted_at < 510);
  REQUIRE(observer.state().valid);
  const Eigen::VectorXd q = Eigen::VectorXd::Map(observer.state().q.data(), kQ);
  const Quaterniond turn(q[3], q[4], q[5], q[6]),
      real(recording[699].q[3], recording[699].q[4], recording[699].q[5], recording[699].q[6]);
  CHECK(((turn.conjugate() * Vector3d::UnitZ()) - (real.conjugate() * Vector3d::UnitZ())).norm() <
        0.02);
  CHECK(std::abs(q[2] - recording[699].q[2]) < 0.02);
}

TEST_CASE("a step in space allocates nothing") {
  const RobotDescription robot = Quadruped();
  const auto recording = Trot(robot, 9);
  StateObserver observer(robot);
  CHECK(AllocationsOf(recording, observer) == 0);
  CHECK(observer.state().valid);
}

}  // namespace
}  // namespace plumb
