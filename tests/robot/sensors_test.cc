#include "robot/sensors.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>

#include "robot/description.h"
#include "tests/replaced.h"
#include "tests/robot/zoo.h"

namespace plumb {
namespace {

using Catch::Contains;

const std::string kSensors = R"([[sensor]]
name = "boom"
protocol = "cia406"
node = 1
period = 0.002
joint = "rail/x"
counts = 65536
range = 268435456
sign = -1
offset = 0.25
radius = 1.5
max_speed = 10.0
[[sensor]]
name = "hip_encoder"
protocol = "cia406"
node = 2
period = 0.002
joint = "hip"
counts = 4096
max_speed = 10.0
[[sensor]]
name = "imu"
protocol = "xsens"
base = 0x380
period = 0.005
link = "carriage"
rpy = [0, 0, 1.5707963267948966]
)";
const std::string kMit = R"(protocol = "mit"
node = 0x11
[joint.mit]
master = 0x10
velocity = 75.0
torque = 18.0
source = "the label"
)";

RobotDescription LoadWithSensors(const std::string& toml) {
  return LoadRobot(RobotFolder(kZooUrdf, toml).path());
}

std::string WithMotor(const std::string& motor) {
  return Replaced(kZooToml, "protocol = \"cansimple\"\nnode = 1\ngear = 6.0\n",
                  "gear = 6.0\n" + motor);
}

TEST_CASE("sensors: encoders and an IMU") {
  const RobotDescription robot = LoadWithSensors(kZooToml + kSensors);
  REQUIRE(robot.sensors.size() == 3);
  const SensorDescription& boom = robot.sensors[0];
  CHECK(boom.name == "boom");
  CHECK(boom.protocol == "cia406");
  CHECK(robot.joints[static_cast<size_t>(boom.joint)].name == "rail/x");
  CHECK(boom.node == 1);
  CHECK(boom.counts == 65536);
  CHECK(boom.range == 268435456);
  CHECK(boom.sign == -1);
  CHECK(boom.offset == 0.25);
  CHECK(boom.radius == 1.5);
  CHECK(boom.max_speed == 10);
  CHECK(boom.period == 0.002);
  CHECK(robot.sensors[1].range == 4096);
  CHECK(robot.sensors[1].radius == 1);
  const SensorDescription& imu = robot.sensors[2];
  CHECK(imu.base == 0x380);
  CHECK(imu.tick == 1e-4);
  CHECK(robot.links[static_cast<size_t>(imu.link)].name == "carriage");
  CHECK((imu.rotation * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm() < 1e-12);
  CHECK(LoadWithSensors(kZooToml).sensors.empty());
}

TEST_CASE("sensors: what is refused") {
  const auto refused = [](const std::string& from, const std::string& to, const std::string& what) {
    INFO(from << " -> " << to);
    CHECK_THROWS_WITH(LoadWithSensors(kZooToml + Replaced(kSensors, from, to)),
                      Contains("robot.toml:") && Contains(what));
  };
  refused("name = \"hip_encoder\"", "name = \"boom\"", "occurs twice");
  refused("name = \"hip_encoder\"", "name = \"hip\"", "is a joint's");
  refused("name = \"hip_encoder\"", "name = \"\"", "is empty");
  refused("\"xsens\"", "\"xsense\"", "protocol");
  refused("node = 1\n", "node = 0\n", "node");
  refused("node = 1\n", "", "node");
  refused("node = 1\n", "node = 1\nbase = 3\n", "base");
  refused("joint = \"hip\"", "joint = \"knee\"", "not a moving joint");
  refused("joint = \"hip\"", "joint = \"free/rotation\"", "spherical");
  refused("joint = \"hip\"", "joint = \"hip\"\nradius = 2", "\"hip\" turns");
  refused("radius = 1.5\n", "", "radius");
  refused("counts = 4096", "counts = 0", "counts");
  refused("counts = 4096", "counts = 40.5", "whole number");
  refused("range = 268435456", "range = 4294967297", "range");
  refused("sign = -1", "sign = 0", "1 or -1");
  refused("max_speed = 10.0\n[[sensor]]\nname = \"imu\"",
          "max_speed = 1600.0\n[[sensor]]\nname = \"imu\"", "half its range");
  refused("link = \"carriage\"", "link = \"carrige\"", "not a link");
  refused("base = 0x380", "base = 0x7C0", "base");
  refused("rpy = [0, 0, 1.5707963267948966]", "rpy = [0, 0]", "rpy");
  refused("period = 0.005", "period = 0", "period");
  for (const char* period : {"0.0005", "0.0025"})
    refused("node = 1\nperiod = 0.002", std::string("node = 1\nperiod = ") + period,
            "whole number of milliseconds");
}

TEST_CASE("noise: of a count, of an IMU, of a joint") {
  const RobotDescription robot = LoadWithSensors(kZooToml + kSensors);
  CHECK(robot.sensors[0].noise.position_sd == Approx(1.5 * 2 * M_PI / 65536 / std::sqrt(12.)));
  CHECK(robot.sensors[1].noise.position_sd == Approx(2 * M_PI / 4096 / std::sqrt(12.)));
  CHECK(std::isnan(robot.sensors[0].noise.velocity_sd));
  CHECK(std::isnan(robot.sensors[0].noise.delay));
  CHECK(robot.sensors[2].acceleration_sd > 0);
  CHECK(robot.estimator.delay == 0);
  CHECK(robot.estimator.outage == 0.05);
  CHECK(robot.estimator.model_acceleration == 0.2);
  CHECK(LoadWithSensors(Replaced(kZooToml, "reset_after = 0.2",
                                 "reset_after = 0.2\nmodel = {acceleration = 3.0}"))
            .estimator.model_acceleration == 3);
  const std::string imu =
      Replaced(kSensors, "base = 0x380",
               "base = 0x380\nangle_sd = 0.003\nrate_bias_sd = 0.2\ndelay = 0.001");
  const RobotDescription told = LoadWithSensors(kZooToml + imu);
  CHECK(told.sensors[2].noise.position_sd == 0.003);
  CHECK(told.sensors[2].rate_bias_sd == 0.2);
  CHECK(told.sensors[2].noise.delay == 0.001);
  const auto refused = [](const std::string& from, const std::string& to, const std::string& what) {
    INFO(from << " -> " << to);
    CHECK_THROWS_WITH(LoadWithSensors(Replaced(kZooToml + kSensors, from, to)),
                      Contains("robot.toml:") && Contains(what));
  };
  refused("base = 0x380", "base = 0x380\nangle_sd = 0", "angle_sd");
  refused("base = 0x380", "base = 0x380\nposition_sd = 0.1", "position_sd");
  refused("node = 2\nperiod", "angle_sd = 0.1\nnode = 2\nperiod", "angle_sd");
  refused("reset_after = 0.2", "reset_after = 0.2\noutage = 0", "outage");
  refused("reset_after = 0.2", "reset_after = 0.2\ndelay = 0.2", "delay");
  refused("reset_after = 0.2", "reset_after = 0.2\nmodel = {acceleration = 0.0}",
          "estimator.model.acceleration");
  refused("reset_after = 0.2", "reset_after = 0.2\nmodel = {jerk = 1.0}", "estimator.model.jerk");
  refused("name = \"disc\"\n", "name = \"disc\"\nestimator = {jerk = -1.0}\n", "jerk");
  refused("name = \"disc\"\n", "name = \"disc\"\nestimator = {lag = 3}\n", "lag");
  const RobotDescription joint = LoadWithSensors(Replaced(
      kZooToml, "name = \"disc\"\n", "name = \"disc\"\nestimator = {jerk = 5.0, delay = 0.002}\n"));
  const auto disc = std::find_if(joint.joints.begin(), joint.joints.end(),
                                 [](const auto& j) { return j.name == "disc"; });
  REQUIRE(disc != joint.joints.end());
  CHECK(disc->noise.jerk == 5);
  CHECK(disc->noise.delay == 0.002);
  CHECK(std::isnan(disc->noise.position_sd));
}

TEST_CASE("MIT motors: ranges with their source") {
  const RobotDescription robot = LoadWithSensors(WithMotor(kMit));
  const MotorDescription& motor = robot.joints[3].motor;
  CHECK(motor.protocol == "mit");
  CHECK(motor.node == 0x11);
  REQUIRE(motor.mit);
  CHECK(motor.mit->master == 0x10);
  CHECK(motor.mit->ranges.position == 12.5);
  CHECK(motor.mit->ranges.velocity == 75);
  CHECK(motor.mit->ranges.torque == 18);
  CHECK(motor.mit->ranges.kp == 500);
  CHECK(motor.mit->ranges.kd == 5);
  CHECK(motor.mit->source == "the label");
  CHECK_FALSE(robot.joints[9].motor.mit);
}

TEST_CASE("RMD motors: a torque constant with its source") {
  const std::string rmd =
      "protocol = \"rmd\"\nnode = 7\n[joint.rmd]\ntorque_constant = 0.5\ncurrent = 8.0\nsource = "
      "\"the data sheet\"\n";
  const RobotDescription robot = LoadWithSensors(WithMotor(rmd));
  const MotorDescription& motor = robot.joints[3].motor;
  REQUIRE(motor.rmd);
  CHECK(motor.node == 7);
  CHECK(motor.rmd->torque_constant == 0.5);
  CHECK(motor.rmd->current == 8);
  CHECK(motor.rmd->watchdog == 0.1);
  CHECK(motor.rmd->source == "the data sheet");
  CHECK_FALSE(motor.mit);
  CHECK(LoadWithSensors(WithMotor(rmd + "watchdog = 0.05\n")).joints[3].motor.rmd->watchdog ==
        0.05);

  const auto refused = [&](const std::string& from, const std::string& to,
                           const std::string& what) {
    INFO(from << " -> " << to);
    CHECK_THROWS_WITH(LoadWithSensors(WithMotor(Replaced(rmd, from, to))),
                      Contains("robot.toml:") && Contains(what));
  };
  refused(rmd.substr(rmd.find("[joint.rmd]")), "", "rmd");
  refused("protocol = \"rmd\"", "protocol = \"cansimple\"", "is of protocol \"rmd\"");
  refused("torque_constant = 0.5", "torque_constant = 0", "torque_constant");
  refused("current = 8.0", "current = 328", "current");
  // 20 Nm behind a gear of 6
  refused("current = 8.0", "current = 6.6", "the joint's limit is 3.33");
  refused("source = \"the data sheet\"", "source = \"\"", "say where");
  refused("current = 8.0", "current = 8.0\nwatchdog = 0", "watchdog");
  refused("current = 8.0", "current = 8.0\ncurent = 8", "did you mean current?");
}

TEST_CASE("moteus: a greatest torque, and a bus that carries CAN FD") {
  const std::string moteus = "protocol = \"moteus\"\nnode = 7\n[joint.moteus]\ntorque = 8.0\n",
                    fd = "data_bit_rate = 5e6\n[driver]";
  const auto load = [&](const std::string& motor) {
    return LoadWithSensors(Replaced(WithMotor(motor), "[driver]", fd));
  };
  const RobotDescription robot = load(moteus);
  const MotorDescription& motor = robot.joints[3].motor;
  REQUIRE(motor.moteus);
  CHECK(motor.node == 7);
  CHECK(motor.moteus->torque == 8);
  CHECK(motor.moteus->watchdog == 0.1);
  CHECK(NeedsFd(motor));
  CHECK_FALSE(NeedsFd(robot.joints[9].motor));
  CHECK(robot.buses[0].data_bit_rate == 5e6);
  CHECK(load(moteus + "watchdog = 0.05\n").joints[3].motor.moteus->watchdog == 0.05);

  const auto refused = [&](const std::string& from, const std::string& to,
                           const std::string& what) {
    INFO(from << " -> " << to);
    CHECK_THROWS_WITH(load(Replaced(moteus, from, to)), Contains("robot.toml:") && Contains(what));
  };
  refused(moteus.substr(moteus.find("[joint.moteus]")), "", "moteus");
  refused("protocol = \"moteus\"", "protocol = \"cansimple\"", "is of protocol \"moteus\"");
  for (const std::string misspelt : {"Moteus", "motues"}) {
    refused("protocol = \"moteus\"", "protocol = \"" + misspelt + "\"",
            "is of protocol \"moteus\", but the motor's is \"" + misspelt + "\"");
  }
  refused("node = 7", "node = 0", "an id from 1 to 126");
  refused("node = 7", "node = 127", "an id from 1 to 126");
  refused("torque = 8.0", "torque = 0", "torque");
  refused("torque = 8.0", "torque = 3.0", "the joint's limit is 3.33");  // 20 Nm behind a gear of 6
  refused("torque = 8.0", "torque = 8.0\nwatchdog = 0", "watchdog");
  refused("torque = 8.0", "torque = 8.0\ntorqe = 8", "did you mean torque?");
  // On a bus that has no FD: the table's line.
  CHECK_THROWS_WITH(LoadWithSensors(WithMotor(moteus)),
                    Contains("robot.toml:4:") && Contains("bus.data_bit_rate is missing") &&
                        Contains("speaks moteus, which needs a bus of CAN FD"));
  CHECK_THROWS_WITH(
      LoadWithSensors(Replaced(WithMotor(moteus), "[driver]", "data_bit_rate = 5e5\n[driver]")),
      Contains("robot.toml:") && Contains("data_bit_rate"));
}

TEST_CASE("MIT motors: what is refused") {
  const auto refused = [](const std::string& from, const std::string& to, const std::string& what) {
    INFO(from << " -> " << to);
    CHECK_THROWS_WITH(LoadWithSensors(WithMotor(Replaced(kMit, from, to))),
                      Contains("robot.toml:") && Contains(what));
  };
  refused(kMit.substr(kMit.find("[joint.mit]")), "", "mit");
  refused("protocol = \"mit\"", "protocol = \"cansimple\"", "is of protocol \"mit\"");
  refused("master = 0x10", "master = 0x11", "id of its replies");
  refused("master = 0x10", "master = 0x800", "master");
  refused("velocity = 75.0", "velocity = 59.0",
          "the joint's limit is 60 rad/s");  // 10 rad/s behind a gear of 6
  refused("torque = 18.0", "torque = 3.0", "Nm at the motor");
  refused("source = \"the label\"", "", "source");
  refused("source = \"the label\"", "source = \"\"", "say where");
  refused("torque = 18.0", "torque = 18.0\nmaximum = 3", "maximum");
}

TEST_CASE("an encoder on a joint with a motor may differ from it by a tolerance") {
  const std::string hip = "node = 2\nperiod = 0.002\n", boom = "node = 1\nperiod = 0.002\n";
  CHECK(std::isinf(LoadWithSensors(kZooToml + kSensors).sensors[1].tolerance));
  CHECK(LoadWithSensors(kZooToml + Replaced(kSensors, hip, hip + "tolerance = 0.05\n"))
            .sensors[1]
            .tolerance == 0.05);
  CHECK_THROWS_WITH(LoadWithSensors(kZooToml + Replaced(kSensors, hip, hip + "tolerance = 0\n")),
                    Contains("tolerance"));
  CHECK_THROWS_WITH(
      LoadWithSensors(kZooToml + Replaced(kSensors, boom, boom + "tolerance = 0.05\n")),
      Contains("\"rail/x\" has no motor"));
}

TEST_CASE("the bus has a bit rate, and drives a telemetry period") {
  CHECK(LoadWithSensors(kZooToml).buses[0].bit_rate == 1e6);
  CHECK(LoadWithSensors(kZooToml).driver.telemetry == 0.1);
  CHECK(LoadWithSensors(
            Replaced(kZooToml, "[driver]", "bit_rate = 500000\n[driver]\ntelemetry = 0.02"))
            .buses[0]
            .bit_rate == 5e5);
  CHECK_THROWS_WITH(LoadWithSensors(Replaced(kZooToml, "[driver]", "bit_rate = 2e6\n[driver]")),
                    Contains("bit_rate"));
}

TEST_CASE("the hopper's boom and IMU have the ids of its plan") {
  const char* source = std::getenv("PLUMBLINE_SOURCE");
  const RobotDescription hopper = LoadRobot(std::string(source ? source : ".") + "/robots/hopper");
  REQUIRE(hopper.sensors.size() == 3);
  CHECK(hopper.sensors[0].node == 1);
  CHECK(hopper.sensors[1].node == 2);
  CHECK(hopper.sensors[2].base == 0x380);
}

}  // namespace
}  // namespace plumb
