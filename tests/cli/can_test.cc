// `plumb can`, run as a person would.
#include <catch2/catch.hpp>
#include <filesystem>
#include <string>

#include "tests/cli/shell.h"
#include "tests/temporary_folder.h"

namespace plumb {

TEST_CASE("can plan: the hopper's bus, and one that cannot work") {
  const Outcome outcome = Shell(Plumb() + "can plan " + Robot("hopper"));
  INFO(outcome.text);
  CHECK(outcome.status == 0);
  for (const char* word : {"0x06e", "Set_Input_Torque", "boom_yaw", "TPDO1", "0x3b2", "at worst",
                           "all deadlines are met"}) {
    CHECK_THAT(outcome.text, Catch::Contains(word));
  }
  const TemporaryFolder folder;
  const std::string toml = Read(Robot("hopper") + "/robot.toml");
  const std::string base = "base = 0x380";
  std::string colliding = toml;
  colliding.replace(colliding.find(base), base.size(), "base = 0x000");
  std::ofstream(folder / "robot.toml") << colliding;
  std::ofstream(folder / "robot.urdf") << Read(Robot("hopper") + "/robot.urdf");
  const Outcome refused = Shell(Plumb() + "can plan " + folder / "robot.toml");
  INFO(refused.text);
  CHECK(refused.status == 1);
  CHECK_THAT(
      refused.text,
      Catch::Contains("error: CAN id 0x021: 'thigh' sends Heartbeat and 'imu' sends Quaternion"));
}

TEST_CASE("an interface's name alone is no bus: the plan says what to write, and so does launch") {
  const TemporaryFolder folder;
  const std::string robot = folder / "robot.toml";
  std::ofstream(robot) << "extends = \"" + Robot("pendulum") +
                              "/robot.toml\"\n[bus]\nurl = \"can0\"\n";
  for (const char* command : {"can plan ", "launch "}) {
    const Outcome refused = Shell(Plumb() + command + robot);
    INFO(refused.text);
    CHECK(refused.status == 1);
    CHECK_THAT(refused.text, Catch::Contains("robot.toml:3:7: bus.url = \"can0\" ") &&
                                 Catch::Contains("write socketcan:can0"));
  }
}

TEST_CASE("of a robot with two buses each has its plan and its DBC file") {
  const std::string robot = Robot("hopper/two_buses.toml");
  const Outcome plan = Shell(Plumb() + "can plan " + robot);
  INFO(plan.text);
  CHECK(plan.status == 0);
  const size_t boom = plan.text.find("\nhopper, bus boom, on udp:239.74.163.2:43114\n");
  REQUIRE(boom != std::string::npos);
  const std::string first = plan.text.substr(0, boom), second = plan.text.substr(boom);
  CHECK_THAT(first, Catch::StartsWith("hopper, bus leg, on udp:239.74.163.2:43113\n") &&
                        Catch::Contains("Set_Input_Torque") && !Catch::Contains("TPDO1") &&
                        Catch::Contains("all deadlines are met"));
  CHECK_THAT(second, Catch::Contains("TPDO1") && !Catch::Contains("Set_Input_Torque") &&
                         Catch::Contains("all deadlines are met"));

  const Outcome dbc = Shell(Plumb() + "can dbc " + robot + " --bus boom");
  CHECK(dbc.status == 0);
  CHECK_THAT(dbc.text, Catch::Contains("boom_yaw_TPDO1") && !Catch::Contains("thigh"));
  for (const char* bus : {"", " --bus lge"}) {
    const Outcome refused = Shell(Plumb() + "can dbc " + robot + bus);
    CHECK(refused.status == 1);
    CHECK_THAT(refused.text, Catch::Contains("is none of the robot's: leg=udp:"));
  }
}

TEST_CASE("can dbc: to the screen or a file, the same") {
  const TemporaryFolder folder;
  const Outcome printed = Shell(Plumb() + "can dbc " + Robot("hopper"));
  CHECK(printed.status == 0);
  CHECK_THAT(printed.text, Catch::Contains("BO_ 41 thigh_Get_Encoder_Estimates: 8 thigh"));
  CHECK(Shell(Plumb() + "can dbc " + Robot("hopper") + " --output " + folder / "bus.dbc").status ==
        0);
  CHECK(Read(folder / "bus.dbc") == printed.text);
}

TEST_CASE("can dbc: what the robot is read from is not written over") {
  const TemporaryFolder folder;
  std::filesystem::copy(Robot("pendulum"), folder / "pendulum");
  for (const char* file : {"robot.toml", "robot.urdf", "gym.toml"}) {
    const std::string input = folder / "pendulum/" + file, before = Read(input);
    const Outcome outcome =
        Shell(Plumb() + "can dbc " + folder / "pendulum/gym.toml" + " --output " + input);
    INFO(outcome.text);
    CHECK(outcome.status == 1);
    CHECK_THAT(outcome.text, Catch::Contains(input + ": is read, too"));
    CHECK(Read(input) == before);
  }
}

TEST_CASE("can: usage") {
  CHECK(Shell(Plumb() + "can").status == 2);
  CHECK(Shell(Plumb() + "can plan").status == 2);
  CHECK(Shell(Plumb() + "can plan /nowhere").status == 1);
  const Outcome level = Shell(Plumb() + "--log-level errror can plan " + Robot("hopper"));
  CHECK(level.status == 2);
  CHECK_THAT(level.text, Catch::Contains("errror"));
}

TEST_CASE("what was printed and could not be written is an error, but for a pipe that was closed") {
  for (const std::string& command : {"can dbc " + Robot("hopper"), "can plan " + Robot("hopper"),
                                     "sim " + Robot("pendulum"), std::string("--help")}) {
    const Outcome full = Shell("(" + Plumb() + command + ") 2>&1 >/dev/full");
    INFO(command);
    CHECK(full.status == 1);
    CHECK(full.text == "plumb: standard output cannot be written: No space left on device\n");
  }
  const std::string more_than_a_pipe_holds =
      Plumb() + "sim " + Robot("hopper/gym.toml") + " --random --episodes 2000";
  CHECK(Shell("{ " + more_than_a_pipe_holds + "; echo status $? >&2; } | head -n 1")
            .text.find("status 0") != std::string::npos);
}

}  // namespace plumb
