// A robot with three motors, two boom encoders and an IMU on one bus: real processes, both
// protocols of motors.

#include <cmath>

#include "calibrator/motion/log_reader.h"
#include "common/lcm_log_writer.h"
#include "estimator/state_observer.h"
#include "plumb/imu_t.hpp"
#include "plumb/joint_state_t.hpp"
#include "tests/process/stage.h"

namespace plumb {
namespace {

template <class Message>
std::string Bytes(const Message& message) {
  std::string bytes(static_cast<size_t>(message.getEncodedSize()), '\0');
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return bytes;
}

TEST_CASE("a log through the estimator gives the recorded states, bit for bit") {
  Stage stage(48, "hopper");
  const std::string log = stage.folder / "run.lcmlog";
  {
    LcmLogWriter writer(log);
    stage.coordinator->on_post = [&](const lockstep_post_t& post, const std::string&) {
      if (post.topic.kind == lockstep_topic_t::MESSAGE)
        writer.Write(post.arrival, post.topic.name, post.data);
    };
    stage.StartAll();
    REQUIRE(stage.Arm(20));
    stage.Listen(2);
    stage.coordinator->on_post = [](const auto&, const auto&) {};
  }

  StateObserver observer(LoadRobot(stage.robot_folder));
  std::vector<std::string> expected, expected_smoothed, recorded, recorded_smoothed;
  int64_t imus = 0;
  ReadLog(log, [&](const std::string& channel, const void* data, int size, int64_t) {
    if (channel == "IMU") {
      imu_t imu;
      REQUIRE(imu.decode(data, 0, size) == size);
      observer.OnImu(imu);
      ++imus;
    } else if (channel == "JOINT_STATE") {
      joint_state_t joints;
      REQUIRE(joints.decode(data, 0, size) == size);
      if (!observer.OnJointState(joints)) return true;
      expected.push_back(Bytes(observer.state()));
      for (const robot_state_t& state : observer.smoothed())
        expected_smoothed.push_back(Bytes(state));
    } else if (channel == "ROBOT_STATE" || channel == "ROBOT_STATE_SMOOTHED") {
      robot_state_t state;
      REQUIRE(state.decode(data, 0, size) == size);
      (channel == "ROBOT_STATE" ? recorded : recorded_smoothed)
          .emplace_back(static_cast<const char*>(data), static_cast<size_t>(size));
    }
    return true;
  });
  REQUIRE(imus > 300);
  REQUIRE(recorded.size() > 800);
  CHECK(expected == recorded);
  REQUIRE(recorded_smoothed.size() > 800);
  CHECK(expected_smoothed == recorded_smoothed);
}

void Stand(const std::string& robot, int number, const std::vector<uint32_t>& from_motors,
           const std::vector<uint32_t>& to_motors) {
  Stage stage(number, robot);
  Subscriber<joint_state_t> joints(stage.messenger, "JOINT_STATE");
  Subscriber<imu_t> imus(stage.messenger, "IMU");
  stage.StartRobotAndDriver();
  stage.Start("plumb-estimator");
  stage.Start("plumb-controller");
  REQUIRE(stage.Arm(20));
  // The controller commands zero: nobody pushes, everybody is heard.
  REQUIRE(stage.WaitUntil([&] { return stage.last_state != 0 && imus.received() > 0; }, 10));
  stage.frames_by_id.clear();
  const int64_t imus_before = imus.received(), joints_before = joints.received();
  stage.Listen(2);
  INFO(stage.Log("plumb-driver"));
  CHECK(stage.drivers.newest().state == driver_status_t::ARMED);

  // Each period once in 2 s, one more or less where it begins in between.
  const auto about = [](int64_t count, int64_t expected) {
    return std::abs(count - expected) <= 1;
  };
  const auto frames = [&](uint32_t id) { return stage.frames_by_id[id]; };
  for (const uint32_t id : from_motors) CHECK(about(frames(id), 1000));
  for (const uint32_t id : to_motors) CHECK(about(frames(id), 1000));
  for (const uint32_t boom : {0x181u, 0x182u}) CHECK(about(frames(boom), 1000));
  for (const uint32_t imu : {0x385u, 0x391u, 0x3A1u, 0x3B2u, 0x3B4u})
    CHECK(about(frames(imu), 400));
  CHECK(about(joints.received() - joints_before, 1000));
  CHECK(about(imus.received() - imus_before, 400));

  const joint_state_t& state = joints.newest();
  REQUIRE(state.num_joints == 6);
  for (size_t i = 0; i < 6; ++i) {
    CHECK(state.valid[i]);
    CHECK(std::isfinite(state.position[i]));
    CHECK(std::abs(state.utime - state.measured[i]) <= 20'000);
  }
  // It has fallen, since nobody held it, as far as its foot on the ground lets it: the rest of it
  // goes through.
  CHECK(std::abs(state.position[1]) < 1.3);
  const imu_t& imu = imus.newest();
  CHECK(imu.link == "torso");
  const double norm = std::hypot(std::hypot(imu.orientation[0], imu.orientation[1]),
                                 std::hypot(imu.orientation[2], imu.orientation[3]));
  CHECK(norm == Approx(1).margin(1e-3));

  const driver_status_t& status = stage.drivers.newest();
  REQUIRE(status.num_sensors == 3);
  for (size_t i = 0; i < 3; ++i) CHECK(status.sensor_state[i] == driver_status_t::SENSOR_RUNNING);
  for (size_t i = 3; i < 6; ++i) CHECK(status.joint_state[i] == driver_status_t::ARMED);
  if (robot == "hopper") CHECK(status.bus_voltage[3] == 24);
  REQUIRE(status.num_phases == 5);
  for (const auto& phase : status.phase_duration) {
    CHECK(phase[0] > 0);
    // they take no time
    CHECK(std::all_of(phase.begin() + 1, phase.end(), [](int64_t count) { return count == 0; }));
  }

  // Without its boom nobody knows where it is.
  const int64_t stalled = stage.Now();
  stage.Stall("plumb-robot", 1);
  CHECK(stage.WaitForDriver(driver_status_t::FAULT, 5));
  CHECK(stage.Now() - stalled <=
        std::llround((stage.robot.driver.stale_after + stage.robot.driver.cycle) * 1e6));
}

TEST_CASE("a hopper on ODrives") { Stand("hopper", 45, {0x29, 0x49, 0x69}, {0x2E, 0x4E, 0x6E}); }

TEST_CASE("a hopper on motors of the MIT protocol") {
  Stand("hopper/mit.toml", 46, {0x101, 0x102, 0x103}, {0x1, 0x2, 0x3});
}

}  // namespace
}  // namespace plumb
