#include "robot/buses.h"

#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "robot/description.h"
#include "tests/replaced.h"
#include "tests/robot/zoo.h"

namespace plumb {
namespace {

using Catch::Contains;
using Catch::StartsWith;

const std::string kOne = "[bus]\nurl = \"udp:239.74.163.2:43113\"\n", kTwo = R"([[bus]]
name = "left"
url = "socketcan:can0"
[[bus]]
name = "right"
url = "socketcan:can1"
bit_rate = 5e5
data_bit_rate = 2e6
)",
                  kEncoder = R"([[sensor]]
name = "rail"
protocol = "cia406"
bus = "left"
node = 1
period = 0.005
counts = 4096
max_speed = 20
joint = "rail/x"
radius = 1.0
)";

/// The zoo with its hip on the left bus and its disc on the right.
std::string TwoBuses() {
  std::string toml = Replaced(kZooToml, kOne, kTwo);
  toml = Replaced(toml, "gear = 6.0\n", "gear = 6.0\nbus = \"left\"\n");
  return Replaced(toml, "node = 2\n", "node = 2\nbus = \"right\"\n") + kEncoder;
}

RobotDescription LoadZoo(const std::string& toml) {
  return LoadRobot(RobotFolder(kZooUrdf, toml).path());
}

void RefusedOfTwoBuses(const std::string& from, const std::string& to, const std::string& what) {
  INFO(from << " -> " << to);
  CHECK_THROWS_WITH(LoadZoo(Replaced(TwoBuses(), from, to)), Contains("robot.toml:" + what));
}

TEST_CASE("one bus needs no name, and nobody needs to name it") {
  const RobotDescription robot = LoadZoo(kZooToml);
  REQUIRE(robot.buses.size() == 1);
  CHECK(robot.buses[0].name.empty());
  CHECK(robot.buses[0].Label() == "the bus");
  CHECK(UrlsOf(robot.buses) == std::vector<std::string>{"udp:239.74.163.2:43113"});
  CHECK(robot.joints[3].motor.bus == 0);
  CHECK_THROWS_WITH(LoadZoo(Replaced(kZooToml, "gear = 6.0\n", "gear = 6.0\nbus = \"left\"\n")),
                    Contains("but the robot has one bus, without a name"));
  // It may have one.
  const std::string named = Replaced(kZooToml, "[bus]\n", "[bus]\nname = \"left\"\n");
  CHECK(LoadZoo(named).buses[0].name == "left");
  CHECK(LoadZoo(Replaced(named, "[bus]", "[[bus]]")).buses[0].name == "left");
  CHECK(LoadZoo(Replaced(named, "gear = 6.0\n", "gear = 6.0\nbus = \"left\"\n"))
            .joints[3]
            .motor.bus == 0);
}

TEST_CASE("of several buses each has its rates, and joints and sensors say which is theirs") {
  const RobotDescription robot = LoadZoo(TwoBuses());
  REQUIRE(robot.buses.size() == 2);
  CHECK(robot.buses[0].name == "left");
  CHECK(robot.buses[0].bit_rate == 1e6);
  CHECK(robot.buses[0].data_bit_rate == 0);
  CHECK(robot.buses[1].Label() == "bus right");
  CHECK(robot.buses[1].url == "socketcan:can1");
  CHECK(robot.buses[1].bit_rate == 5e5);
  CHECK(robot.buses[1].data_bit_rate == 2e6);
  CHECK(robot.joints[3].motor.bus == 0);
  CHECK(robot.joints[9].motor.bus == 1);
  CHECK(robot.sensors[0].bus == 0);
  CHECK(InOneLine(robot.buses) == "left=socketcan:can0 right=socketcan:can1");
}

TEST_CASE("one id on two buses is two drives, on one bus it is a mistake") {
  const std::string same = Replaced(TwoBuses(), "node = 2\n", "node = 1\n");
  CHECK(LoadZoo(same).joints[9].motor.node == 1);
  CHECK_THROWS_WITH(LoadZoo(Replaced(same, "bus = \"right\"", "bus = \"left\"")),
                    Contains("joint[2].node = 1 is also joint hip's, on bus left"));
}

TEST_CASE("mistakes about buses are at their lines") {
  RefusedOfTwoBuses("bus = \"left\"\n[joint", "[joint",
                    "20:1: joint[0].bus is missing: the robot has several, left, right");
  RefusedOfTwoBuses("bus = \"right\"\n", "bus = \"rigth\"\n",
                    "45:7: joint[2].bus = \"rigth\" is none of the buses left, right");
  RefusedOfTwoBuses("bus = \"left\"\nnode", "node", "127:1: sensor[0].bus is missing");
  RefusedOfTwoBuses("bus = \"left\"\nnode", "bus = \"\"\nnode",
                    "130:7: sensor[0].bus = \"\" is none");
  RefusedOfTwoBuses("name = \"right\"\n", "name = \"left\"\n",
                    "8:8: bus[1].name = \"left\" occurs twice");
  RefusedOfTwoBuses("name = \"right\"\n", "", "7:1: bus[1].name is missing");
  RefusedOfTwoBuses("name = \"right\"", "name = \"the right\"",
                    "8:8: bus[1].name = \"the right\" is not of");
  RefusedOfTwoBuses("socketcan:can1", "socketcan:can0",
                    "9:7: bus[1].url = \"socketcan:can0\" is also bus left's");
  RefusedOfTwoBuses("socketcan:can1", "faulty:loss=0.1:socketcan:can0", "9:7: bus[1].url");
  RefusedOfTwoBuses("bit_rate = 5e5", "bitrate = 5e5", "10:11: bus[1].bitrate is not a known key");
  RefusedOfTwoBuses("passive = true\n", "passive = true\nbus = \"left\"\n",
                    "39:7: joint[1].bus is of a motor, but the joint is passive");
  for (const std::string fd : {"fd", "canfd", "can_fd"}) {
    RefusedOfTwoBuses("data_bit_rate = 2e6", fd + " = true",
                      "11:" + std::to_string(fd.size() + 4) + ": bus[1]." + fd +
                          " is not a known key: a bus carries CAN FD where it has data_bit_rate");
  }
  // Nothing is on it.
  RefusedOfTwoBuses("[driver]", "[[bus]]\nname = \"spare\"\nurl = \"socketcan:can2\"\n[driver]",
                    "13:8: bus[2].name = \"spare\" has no joint and no sensor on it");
  std::string many;
  for (int i = 0; i < 15; ++i)
    many += "[[bus]]\nname = \"b" + std::to_string(i) + "\"\nurl = \"loop:" + std::to_string(i) +
            "\"\n";
  RefusedOfTwoBuses("[driver]", many + "[driver]",
                    "55:8: bus[16].name is one too many: 16 buses at most");
}

TEST_CASE("CAN FD is needed of the bus that its drive is on") {
  const std::string moteus =
      "protocol = \"moteus\"\nnode = 7\nbus = \"right\"\n[joint.moteus]\ntorque = 30.0\n";
  const std::string disc = "protocol = \"cansimple\"\nnode = 2\nbus = \"right\"\n";
  CHECK(LoadZoo(Replaced(TwoBuses(), disc, moteus)).joints[9].motor.moteus);
  CHECK_THROWS_WITH(
      LoadZoo(Replaced(TwoBuses(), disc, Replaced(moteus, "bus = \"right\"", "bus = \"left\""))),
      Contains("robot.toml:4:1: bus[0].data_bit_rate is missing: joint \"disc\" speaks moteus"));
}

TEST_CASE("--bus gives the only bus, or one of several by its name, another URL") {
  std::vector<BusDescription> one(1), two(2);
  one[0].url = "socketcan:can0";
  SetUrls(one, {"faulty:loss=0.1:udp:239.74.163.2:1"});
  CHECK(one[0].url == "faulty:loss=0.1:udp:239.74.163.2:1");
  CHECK_THROWS_WITH(SetUrls(one, {"left=loop:"}), Contains("no bus of the robot has that name"));

  two[0] = {.name = "left", .url = "socketcan:can0"};
  two[1] = {.name = "right", .url = "socketcan:can1"};
  SetUrls(two, {"right=faulty:loss=0.1:loop:b"});
  CHECK(UrlsOf(two) ==
        std::vector<std::string>{"left=socketcan:can0", "right=faulty:loss=0.1:loop:b"});
  CHECK_THROWS_WITH(SetUrls(two, {"loop:b"}), Contains("several buses (left, right)"));
  CHECK_THROWS_WITH(SetUrls(two, {"lift=loop:b"}), Contains("there are: left, right"));
  CHECK_THROWS_WITH(SetUrls(two, {"left=loop:b"}), Contains("left and right are both loop:b") ||
                                                       Contains("left and right are both faulty"));
  CHECK_THROWS_WITH(SetUrls(two, {""}), StartsWith("--bus "));
}

TEST_CASE("an interface's name alone is no bus, and what to write is said") {
  CHECK_THROWS_WITH(
      LoadZoo(Replaced(kZooToml, "udp:239.74.163.2:43113", "can0")),
      Contains("robot.toml:5:7: bus.url = \"can0\" ") && Contains("write socketcan:can0"));
  std::vector<BusDescription> one(1), two(2);
  two[0].name = "left", two[1].name = "right";
  CHECK_THROWS_WITH(SetUrls(one, {"can1"}),
                    StartsWith("--bus can1: ") && Contains("write socketcan:can1"));
  CHECK_THROWS_WITH(SetUrls(two, {"right=can1"}),
                    StartsWith("--bus right=can1: ") && Contains("write socketcan:can1"));
}

TEST_CASE("a file that extends one with one bus may have several") {
  const RobotFolder folder(kZooUrdf, kZooToml);
  const std::string file = folder.path() + "/two.toml";
  std::ofstream(file) << "extends = \"robot.toml\"\n"
                      << kTwo << "[[joint]]\nname = \"hip\"\nbus = \"left\"\n"
                      << "[[joint]]\nname = \"disc\"\nbus = \"right\"\n";
  CHECK(LoadRobot(file).buses.size() == 2);
}

}  // namespace
}  // namespace plumb
