// Robots with several buses: one driver, one virtual robot, real processes on each bus.

#include <array>
#include <nlohmann/json.hpp>
#include <set>

#include "plumb/imu_t.hpp"
#include "plumb/joint_state_t.hpp"
#include "tests/legs_on_stand.h"
#include "tests/process/launch.h"

namespace plumb {
namespace {

using Catch::Contains;

/// A bus of udp: of this test's own: `stage` has 23200 and its number.
std::string Url(int number, int index) {
  return fmt::format("udp:239.74.163.2:{}", 23500 + 10 * number + index);
}

/// How many frames of each id there were.
using Counts = std::map<uint32_t, int64_t>;

std::set<uint32_t> Ids(const Counts& counts) {
  std::set<uint32_t> ids;
  for (const auto& [id, count] : counts) ids.insert(id);
  return ids;
}

/// The hopper's processes, its boom's bus at the driver's end with faults.
struct Hopper {
  explicit Hopper(int number, const std::string& faults = "",
                  const std::string& file = "hopper/two_buses.toml")
      : stage(number, file) {
    stage.Hear(Url(number, 1), [this](const Frame& frame) { ++boom[frame.id]; });
    const std::string leg = "leg=" + stage.bus_url, url = Url(number, 1);
    stage.Start("plumb-robot", {"--bus", leg, "--bus", "boom=" + url, "--seed", "1"});
    stage.Start("plumb-driver", {"--bus", leg, "--bus", "boom=" + faults + url, "--virtual",
                                 "--flight-recorder", stage.folder / "faults"});
    stage.Start("plumb-estimator");
    stage.Start("plumb-controller");
    REQUIRE(stage.WaitUntil([&] { return stage.controllers.received() > 0; }, 20));
  }

  Stage stage;
  Counts boom;  ///< of its bus
};

/// @param ids of the drives' torques and answers.
void Stand(int number, const std::string& file, const std::vector<uint32_t>& ids) {
  Hopper hopper(number, "", file);
  Stage& stage = hopper.stage;
  Subscriber<joint_state_t> joints(stage.messenger, "JOINT_STATE");
  Subscriber<imu_t> imus(stage.messenger, "IMU");
  REQUIRE(stage.Arm(20));
  stage.Listen(0.5);
  stage.frames_by_id.clear();
  hopper.boom.clear();
  const int64_t states = joints.received(), readings = imus.received();
  stage.Listen(1);
  CHECK(std::abs(joints.received() - states - 500) <= 1);
  CHECK(std::abs(imus.received() - readings - 200) <= 1);
  for (size_t i = 0; i < 6; ++i) CHECK(joints.newest().valid[i]);
  // Torques and estimates of nodes 1 to 3 on the leg's bus, encoders and IMU on the boom's.
  for (const uint32_t id : ids) {
    INFO(id);
    CHECK(std::abs(stage.frames_by_id[id] - 500) <= 1);
    CHECK(hopper.boom.count(id) == 0);
  }
  for (const uint32_t id : {0x181u, 0x182u}) {
    INFO(id);
    CHECK(std::abs(hopper.boom[id] - 500) <= 1);
    CHECK(stage.frames_by_id.count(id) == 0);
  }
  const driver_status_t& status = stage.drivers.newest();
  REQUIRE(status.num_buses == 2);
  CHECK(status.bus == "leg=" + stage.bus_url + " boom=" + Url(number, 1));
  for (const bus_status_t& bus : status.buses) {
    CHECK(bus.up);
    CHECK(bus.frames_rejected == 0);
    CHECK(bus.frames_dropped == 0);
  }
  CHECK(status.buses[0].name == "leg");
  CHECK(status.buses[1].url == Url(number, 1));
  CHECK(status.buses[0].frames_sent > status.buses[1].frames_sent);
  CHECK(status.buses[1].frames_received > 1000);
}

TEST_CASE("the hopper on two buses: drives on one, boom and IMU on the other, one state of all") {
  Stand(125, "hopper/two_buses.toml", {0x02E, 0x04E, 0x06E, 0x029, 0x049, 0x069});
}

TEST_CASE("the hopper on three moteus: a bus that carries CAN FD beside one that does not") {
  Stand(130, "hopper/moteus.toml", {0x8001, 0x8002, 0x8003, 0x100, 0x200, 0x300});
}

TEST_CASE("a bus that fails stops the drives on the other, and each bus has its recording") {
  // By this chance, when the robot has moved for a while.
  Hopper hopper(126, "faulty:busoff=0.0001,seed=2:");
  Stage& stage = hopper.stage;
  REQUIRE(stage.Arm(20));
  REQUIRE(
      stage.WaitUntil([&] { return stage.drivers.newest().state == driver_status_t::FAULT; }, 60));
  CHECK(stage.drivers.newest().reason == "bus boom: the CAN controller went bus-off");
  CHECK(stage.WaitUntil([&] { return stage.axis_state == 1; }, 1));
  CHECK(stage.drivers.newest().buses[0].up);
  // It comes back by itself, and the robot stays where it is until a person arms it.
  CHECK(stage.WaitUntil([&] { return stage.drivers.newest().buses[1].up; }, 1));
  stage.Listen(1);
  CHECK(stage.drivers.newest().state == driver_status_t::FAULT);
  CHECK(stage.axis_state == 1);

  const auto recording = [&](const std::string& bus) {
    std::string text;
    for (const auto& file : std::filesystem::directory_iterator(stage.folder / "faults")) {
      if (file.path().string().ends_with("_" + bus + ".log")) text = Read(file.path());
    }
    return text;
  };
  REQUIRE(AwaitReally([&] { return !recording("leg").empty() && !recording("boom").empty(); }));
  for (const char* bus : {"leg", "boom"})
    CHECK_THAT(recording(bus), Catch::StartsWith("# bus boom: the CAN controller went bus-off"));
  CHECK_THAT(recording("leg"), Contains(" 02E#") && !Contains(" 181#"));
  CHECK_THAT(recording("boom"), Contains(" 181#") && !Contains(" 02E#"));
  CHECK(stage.Arm(20));
}

TEST_CASE("twelve drives on four buses at 500 Hz, with the same ids on each") {
  Stage stage(127);
  std::array<std::string, 4> urls;
  for (size_t i = 0; i < urls.size(); ++i)
    urls[i] = i == 0 ? stage.bus_url : Url(127, static_cast<int>(i));
  LegsOnStand::Write(Stage::Environment("PLUMBLINE_SOURCE", ".") + "/robots", stage.folder / "legs",
                     urls);
  stage.robot_folder = stage.folder / "legs";
  std::array<Counts, 3> others;
  for (size_t i = 1; i < urls.size(); ++i)
    stage.Hear(urls[i], [&counts = others[i - 1]](const Frame& frame) { ++counts[frame.id]; });
  Subscriber<joint_state_t> joints(stage.messenger, "JOINT_STATE");
  for (const char* name : {"plumb-robot", "plumb-estimator", "plumb-controller"}) stage.Start(name);
  stage.Start("plumb-driver", {"--virtual"});
  REQUIRE(stage.Arm(20));
  stage.Listen(0.5);
  stage.frames_by_id.clear();
  others = {};
  const int64_t states = joints.received();
  stage.Listen(1);
  CHECK(stage.drivers.newest().state == driver_status_t::ARMED);
  CHECK(std::abs(joints.received() - states - 500) <= 1);
  CHECK(joints.newest().num_joints == 12);
  for (size_t i = 0; i < 12; ++i) CHECK(joints.newest().valid[i]);
  for (const uint32_t id : {0x02Eu, 0x04Eu, 0x06Eu, 0x029u, 0x049u, 0x069u}) {
    CHECK(std::abs(stage.frames_by_id[id] - 500) <= 1);
    for (const Counts& counts : others) CHECK(std::abs(counts.at(id) - 500) <= 1);
  }
  for (const Counts& counts : others) CHECK(Ids(counts) == Ids(others[0]));
}

TEST_CASE("plumb launch runs a robot on two buses, and records each by its name") {
  Stage stage(128, "double_pendulum", Stage::Time::kReal);
  const std::filesystem::path file = stage.folder / "robot.toml";
  const std::string second = Url(128, 1);
  std::ofstream(file) << fmt::format(R"(extends = "{0}/robot.toml"
[robot]
urdf = "{0}/robot.urdf"
[[bus]]
name = "upper"
url = "udp:239.74.163.2:1"
[[bus]]
name = "lower"
url = "{1}"
[[joint]]
name = "shoulder"
bus = "upper"
[[joint]]
name = "elbow"
node = 1
bus = "lower"
[training]
updates = 2
updates_again = 1
)",
                                     stage.robot_folder, second);
  const std::string can_log = stage.folder / "can.log", summary = stage.folder / "summary.json";
  Child launch("plumb",
               {Stage::Binary("plumb"), "launch", file, "--lcm-url", stage.lcm_url, "--bus",
                "upper=" + stage.bus_url, "--iterations", "1", "--evaluation-episodes", "1",
                "--can-log", can_log, "--summary", summary, "--output", stage.folder / "run"},
               stage.folder / "launch.log");
  REQUIRE(AwaitReally([&] { return !launch.running(); }));
  INFO(launch.Tail(20));
  CHECK(launch.WaitFor(1));
  const std::string said = Read(stage.folder / "launch.log"), frames = Read(can_log),
                    buses = "upper=" + stage.bus_url + " lower=" + second;
  CHECK_THAT(said, Contains("double_pendulum on " + buses + ", seed 1"));
  CHECK_THAT(said, Contains("final policy on the robot"));
  CHECK(nlohmann::json::parse(Read(summary))["bus"] == buses);
  for (const char* line : {" upper 02E#", " lower 02E#", " upper 029#", " lower 029#"})
    CHECK_THAT(frames, Contains(line));
  CHECK_THAT(frames, !Contains(" can0 "));
}

TEST_CASE("a bus that the robot does not have is refused, by whoever is told of it") {
  Stage stage(129, "hopper/two_buses.toml", Stage::Time::kReal);
  for (const char* name : {"plumb-robot", "plumb-driver"}) {
    Child& child = stage.Start(name, {"--bus", stage.bus_url});
    REQUIRE(child.WaitFor(60));
    CHECK_THAT(stage.Log(name), Contains("--bus " + stage.bus_url +
                                         ": the robot has several buses (leg, boom): --bus "
                                         "NAME=URL"));
  }
}

}  // namespace
}  // namespace plumb
