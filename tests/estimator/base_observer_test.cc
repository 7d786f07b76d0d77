// A simulated hopper without its boom: what its IMU and its leg tell, beside what the boom told.

#include "estimator/base_observer.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "tests/estimator/allocations_of.h"
#include "tests/estimator/observer_errors.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

RobotDescription Free() {
  return WithSimulatedNoise(LoadRobot(SourceFile("robots/hopper/free.toml")));
}

/// Stands for 0.6 s, then hops on its foot, which bounces, creeps and hangs in the air in turn. 3
/// s.
std::vector<SimulatedReadings::Sample> HopUpright(const RobotDescription& robot, uint32_t seed,
                                                  double height = 0.1) {
  Random random(seed, {44});
  Eigen::VectorXd q(6), v = Eigen::VectorXd::Zero(6);
  q << 0, 1.22, 0, -0.05, -0.1, 0.1;
  const double frequency = random.Uniform(1.5, 2.5);
  return SimulatedReadings(robot, seed)
      .Run(q, v, 3, 8000, [=](double t, const auto& q_now, const auto& v_now) {
        const double bend =
            t < 0.6 ? 0 : 0.5 - 0.5 * std::cos(2 * std::numbers::pi * frequency * (t - 0.6));
        Eigen::Vector3d target(-0.1 - height * bend, -0.2 - 2 * height * bend, 0.1 + height * bend);
        // keeps its balance
        target[2] = std::clamp(target[2] - 2 * q_now[2] - 0.3 * v_now[2], -0.7, 0.7);
        return Eigen::VectorXd(600 * (target - q_now.template tail<3>()) -
                               30 * v_now.template tail<3>());
      });
}

struct BaseErrors {
  StateErrors base[3];           // x, z, pitch
  double valid = 0, flying = 0;  // shares
  int64_t restarts = 0;
};

/// @param from sample on.
BaseErrors ErrorsOf(const RobotDescription& robot, const Recordings& recordings, int64_t from = 0) {
  BaseErrors errors;
  double count = 0;
  for (const auto& recording : recordings) {
    StateObserver observer(robot);
    for (const SimulatedReadings::Sample& sample : recording) {
      for (const imu_t& imu : sample.imus) observer.OnImu(imu);
      REQUIRE(observer.OnJointState(sample.joints));
      const robot_state_t& state = observer.state();
      if (state.sequence < from) continue;
      ++count;
      if (!state.valid) continue;
      ++errors.valid;
      errors.flying += state.contact == std::vector<int8_t>{0, 0};
      for (size_t i = 0; i < 3; ++i) {
        const auto at = static_cast<Eigen::Index>(i);
        errors.base[i].Add(state.q[i] - sample.q[at], state.v[i] - sample.v[at], state.q_sd[i],
                           state.v_sd[i]);
      }
    }
    errors.restarts += observer.restarts();
  }
  errors.valid /= count;
  errors.flying /= count;
  return errors;
}

std::string Describe(const BaseErrors& e) {
  std::string text;
  for (const StateErrors& joint : e.base) {
    text += "| " + std::to_string(joint.q()) + " | " + std::to_string(joint.v()) + " | " +
            std::to_string(joint.nees_q()) + " | " + std::to_string(joint.nees_v()) + " | " +
            std::to_string(joint.covered_v()) + "\n";
  }
  return text + "valid " + std::to_string(e.valid) + ", in the air " + std::to_string(e.flying);
}

TEST_CASE("a hopper without a boom knows its height, pitch and velocities") {
  const RobotDescription robot = Free();
  Recordings recordings;
  for (uint32_t seed = 1; seed <= 8; ++seed) recordings.push_back(HopUpright(robot, seed));
  const BaseErrors legs = ErrorsOf(robot, recordings);
  Recordings on_boom;
  const RobotDescription boom = WithSimulatedNoise(LoadRobot(SourceFile("robots/hopper")));
  for (uint32_t seed = 1; seed <= 8; ++seed) on_boom.push_back(HopUpright(boom, seed));
  const BaseErrors beside = ErrorsOf(boom, on_boom);
  INFO("x, z, pitch: q, v, NEES q, NEES v, within 95 %\n"
       << Describe(legs) << "\non the boom\n"
       << Describe(beside));
  CHECK(legs.valid > 0.95);
  CHECK(legs.flying > 0.2);
  CHECK(legs.base[0].v() < 0.15);
  CHECK(legs.base[1].q() < 0.025);
  CHECK(legs.base[1].v() < 0.1);
  CHECK(legs.base[2].q() < 0.02);
  CHECK(legs.base[2].v() < 0.1);
  for (const StateErrors& joint : legs.base) {
    CHECK(joint.covered_v() > 0.88);
    CHECK(joint.nees_v() < 2);
    CHECK(joint.nees_q() < 2);
  }
  // A boom is better, at what it measures.
  CHECK(beside.base[1].q() < 0.01 * legs.base[1].q() + 1e-3);
}

/// The same through an accelerometer that ends there [m/s^2] and says so.
void Clip(Recordings& recordings, double end) {
  for (auto& recording : recordings) {
    for (SimulatedReadings::Sample& sample : recording) {
      for (imu_t& imu : sample.imus) {
        for (double& force : imu.force) {
          imu.force_clipped = imu.force_clipped || std::abs(force) > end;
          force = std::clamp(force, -end, end);
        }
      }
    }
  }
}

TEST_CASE("landings that are somewhat beyond the accelerometer's range are not missed") {
  const RobotDescription robot = Free();
  Recordings recordings;
  for (uint32_t seed = 1; seed <= 8; ++seed) recordings.push_back(HopUpright(robot, seed));
  Clip(recordings, 80);
  const BaseErrors legs = ErrorsOf(robot, recordings);
  INFO("x, z, pitch: q, v, NEES q, NEES v, within 95 %\n" << Describe(legs));
  // Readings that are left out, or believed, make the velocity upwards wrong by 0.20 and 0.16 m/s,
  // with an NEES of 31 and 22.
  CHECK(legs.base[1].v() < 0.15);
  CHECK(legs.base[1].nees_v() < 8);
  CHECK(legs.base[1].nees_q() < 5);
}

TEST_CASE("placed a few centimetres above the ground it is known at once, and when it has landed") {
  const RobotDescription robot = Free();
  Eigen::VectorXd q(6), v = Eigen::VectorXd::Zero(6);
  q << 0, 1.25, 0, 0, 0, 0;  // gym's hopper begins like that
  const auto recording = SimulatedReadings(robot, 4).Run(
      q, v, 0.5, 8000, [](double, const auto& q_now, const auto& v_now) {
        return Eigen::VectorXd(-600 * q_now.template tail<3>() - 30 * v_now.template tail<3>());
      });
  StateObserver observer(robot);
  int valid = 0;
  for (size_t k = 0; k < recording.size(); ++k) {
    for (const imu_t& imu : recording[k].imus) observer.OnImu(imu);
    observer.OnJointState(recording[k].joints);
    const robot_state_t& state = observer.state();
    if (!state.valid) continue;
    ++valid;
    INFO(k);
    CHECK(std::abs(state.q[1] - recording[k].q[1]) < (k < 120 ? 0.08 : 0.03));
    CHECK(std::abs(state.q[2] - recording[k].q[2]) < 0.02);
    if (k > 120) CHECK(std::abs(state.v[1] - recording[k].v[1]) < 0.15);
  }
  CHECK(valid > 220);
}

TEST_CASE(
    "dropped from higher than it was told, bouncing and tumbling, it finds its height within 0.6 "
    "s") {
  const RobotDescription robot = Free();
  const BaseErrors legs = ErrorsOf(robot, Record(robot, 1, 6), 300);
  INFO("x, z, pitch: q, v, NEES q, NEES v, within 95 %\n" << Describe(legs));
  CHECK(legs.valid > 0.6);
  CHECK(legs.base[1].q() < 0.06);  // of states that are valid up to an sd of 0.1
  CHECK(legs.base[1].v() < 0.2);
  CHECK(legs.base[2].q() < 0.04);
}

TEST_CASE("the horizontal position grows unsure, height does not") {
  const RobotDescription robot = Free();
  const auto recording = HopUpright(robot, 3, 0);
  StateObserver observer(robot);
  double x_sd = 0, z_sd = 0;
  for (size_t k = 0; k < recording.size(); ++k) {
    for (const imu_t& imu : recording[k].imus) observer.OnImu(imu);
    observer.OnJointState(recording[k].joints);
    if (k == 250) x_sd = observer.state().q_sd[0], z_sd = observer.state().q_sd[1];
  }
  REQUIRE(observer.state().valid);
  CHECK(observer.state().q_sd[0] > 1.5 * x_sd);
  CHECK(observer.state().q_sd[1] < 1.2 * z_sd);
  CHECK(observer.state().contact == std::vector<int8_t>{1, 1});
}

TEST_CASE("a pitch guessed wrong is found, and a heading wrong from the start does not matter") {
  RobotDescription robot = Free();
  for (SensorDescription& sensor : robot.sensors) sensor.noise.position_sd = 0.08;
  auto recording = HopUpright(robot, 5, 0);
  const Eigen::Quaterniond wrong =
      Eigen::Quaterniond(Eigen::AngleAxisd(1.3, Eigen::Vector3d::UnitZ())) *
      Eigen::Quaterniond(Eigen::AngleAxisd(0.08, Eigen::Vector3d::UnitY()));
  StateObserver observer(robot);
  double at_first = 0;
  for (SimulatedReadings::Sample& sample : recording) {
    for (imu_t& imu : sample.imus) {
      const auto& [w, x, y, z] = imu.orientation;
      const Eigen::Quaterniond told = wrong * Eigen::Quaterniond(w, x, y, z);
      imu.orientation[0] = told.w(), imu.orientation[1] = told.x(), imu.orientation[2] = told.y(),
      imu.orientation[3] = told.z();
      observer.OnImu(imu);
    }
    observer.OnJointState(sample.joints);
    if (at_first == 0 && std::isfinite(observer.state().q[2]))
      at_first = observer.state().q[2] - sample.q[2];
  }
  CHECK(at_first > 0.05);
  REQUIRE(observer.state().valid);
  CHECK(std::abs(observer.state().q[2] - recording.back().q[2]) < 0.02);
}

TEST_CASE("without its IMU for longer than an outage the base is not known, and then it is again") {
  const RobotDescription robot = Free();
  const auto recording = HopUpright(robot, 7, 0);
  StateObserver observer(robot);
  for (size_t k = 0; k < recording.size(); ++k) {
    const bool silent = k >= 500 && k < 600;
    for (const imu_t& imu : recording[k].imus) {
      if (!silent) observer.OnImu(imu);
    }
    observer.OnJointState(recording[k].joints);
    if (k == 520) CHECK(observer.state().valid);
    if (k < 530 || k >= 600) continue;
    CHECK_FALSE(observer.state().valid);
    CHECK(observer.state().contact == std::vector<int8_t>{-1, -1});
    CHECK_THAT(observer.Status().reason, Catch::Contains("rootx"));
  }
  CHECK(observer.state().valid);
}

TEST_CASE("a leg's encoder that comes back in mid-air does not bring its base to a stand") {
  const RobotDescription robot = Free();
  BaseErrors errors;
  double fastest = 0;
  for (uint32_t seed = 1; seed <= 8; ++seed) {
    const auto recording = HopUpright(robot, seed);
    for (size_t back = 600; back < recording.size(); back += 97) {
      StateObserver observer(robot);
      for (size_t k = 0; k < std::min(back + 25, recording.size()); ++k) {
        SimulatedReadings::Sample sample = recording[k];
        if (k < back && k + 40 >= back) sample.joints.valid[5] = 0;  // the foot's, for 80 ms
        for (const imu_t& imu : sample.imus) observer.OnImu(imu);
        REQUIRE(observer.OnJointState(sample.joints));
        const robot_state_t& state = observer.state();
        if (k + 1 == back) CHECK_FALSE(state.valid);
        if (k == back) CHECK(state.restarted);
        if (k < back || !state.valid) continue;
        fastest = std::max(fastest, std::abs(sample.v[1]));
        for (size_t i = 0; i < 3; ++i) {
          const auto at = static_cast<Eigen::Index>(i);
          errors.base[i].Add(state.q[i] - sample.q[at], state.v[i] - sample.v[at], state.q_sd[i],
                             state.v_sd[i]);
        }
      }
    }
  }
  INFO("x, z, pitch: q, v, NEES q, NEES v, within 95 %\n" << Describe(errors));
  CHECK(fastest > 1);  // m/s
  CHECK(errors.base[1].v() < 0.15);
  CHECK(errors.base[1].nees_v() < 3);
}

TEST_CASE("what waits to be smoothed when all begins anew has its base smoothed, too") {
  const RobotDescription robot = Free();
  const auto recording = HopUpright(robot, 3);
  StateObserver observer(robot);
  std::vector<robot_state_t> causal;
  for (size_t k = 0; k < 900; ++k) {
    for (const imu_t& imu : recording[k].imus) observer.OnImu(imu);
    REQUIRE(observer.OnJointState(recording[k].joints));
    causal.push_back(observer.state());
  }
  joint_state_t later = recording[900].joints;
  later.utime += 2'000'000;  // a gap after which nothing is known
  for (int64_t& measured : later.measured) measured += 2'000'000;
  REQUIRE(observer.OnJointState(later));
  REQUIRE(observer.state().restarted);
  const auto smoothed = observer.smoothed();
  REQUIRE(smoothed.size() > 10);
  const robot_state_t& first = smoothed.front();
  const robot_state_t& before = causal[causal.size() - smoothed.size()];
  REQUIRE(first.sequence == before.sequence);
  CHECK(first.v[1] != before.v[1]);
  CHECK(first.v_sd[1] < before.v_sd[1]);
}

TEST_CASE("noise is learnt of the legs' joints, the base's are left alone") {
  const RobotDescription robot = Free();
  const Recordings recordings = {HopUpright(robot, 11)};
  const TunedNoise noise =
      TuneNoise(robot, [&](StateObserver& observer) { Play(recordings, observer); });
  for (size_t i = 0; i < 6; ++i) CHECK((noise.after[i] < noise.before[i]) == (i >= 3));
}

TEST_CASE("a step without a boom allocates nothing") {
  const RobotDescription robot = Free();
  const auto recording = HopUpright(robot, 9);
  StateObserver observer(robot);
  CHECK(AllocationsOf(recording, observer) == 0);
  CHECK(observer.state().valid);
}

}  // namespace
}  // namespace plumb
