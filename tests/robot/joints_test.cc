#include "robot/joints.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "robot/description.h"
#include "tests/replaced.h"
#include "tests/robot/zoo.h"

namespace plumb {
namespace {

using Catch::Contains;

RobotDescription Load(const std::string& toml, const std::string& urdf = kZooUrdf) {
  return LoadRobot(RobotFolder(urdf, toml).path());
}

void Refused(const std::string& from, const std::string& to, const std::string& what) {
  INFO(from << " -> " << to);
  CHECK_THROWS_WITH(Load(Replaced(kZooToml, from, to)), Contains("robot.toml:") && Contains(what));
}

TEST_CASE("joints have motors or are passive, with their dynamics") {
  const RobotDescription zoo = Load(kZooToml);
  CHECK(zoo.driven() == std::vector<int>{3, 9});
  CHECK(zoo.effort_limits() == Eigen::Vector2d(20, 3));
  CHECK(zoo.num_positions() == 9 + 4);
  CHECK(zoo.num_velocities() == 9 + 3);
  const JointDynamics& hip = zoo.joints[3].dynamics;
  CHECK(zoo.joints[3].motor.gear == 6);
  CHECK(hip.armature == 0.01);
  CHECK(hip.damping == 0.3);   // the TOML's
  CHECK(hip.friction == 0.2);  // the URDF's
  CHECK(hip.stiffness == 1);
  CHECK(hip.rest == 0.1);
  CHECK(hip.motor_gain == 0.9);
  CHECK(hip.delay == 0.004);
  CHECK(hip.sensor_delay == 0.002);
  CHECK(hip.sensor_bias == -0.01);
  CHECK(hip.no_load_speed == 12);
  CHECK(zoo.joints[4].passive);
  CHECK(zoo.joints[4].dynamics.stiffness == 5000);
  for (const size_t i : {0, 1, 2, 5, 6, 7, 8}) {
    CHECK(zoo.joints[i].passive);  // without a table
    CHECK(zoo.joints[i].effort_limit == 0);
    CHECK(zoo.joints[i].dynamics.motor_gain == 1);
    CHECK(std::isinf(zoo.joints[i].dynamics.no_load_speed));
  }
  REQUIRE(zoo.simulation.contact);
  CHECK(zoo.simulation.contact->stiffness == 20000);
  CHECK(zoo.simulation.contact->damping == 100);
  CHECK(zoo.simulation.contact->friction == 0.8);
  CHECK(zoo.simulation.contact->slip_speed == 0.01);
  REQUIRE(zoo.simulation.stop);
  CHECK(zoo.simulation.stop->stiffness == 500);
  CHECK(zoo.simulation.stop->damping == 5);
  REQUIRE(zoo.frozen.size() == 1);
  CHECK(zoo.FindParameter("damping/hip") == -1);
}

TEST_CASE("limits of a joint with a motor") {
  const std::string table =
      "[joint.limits]\nposition_margin = 0.2\neffort_rate = 400\ndamping = "
      "1.5\n[joint.dynamics]\narmature = "
      "0.01";
  const RobotDescription zoo = Load(Replaced(kZooToml, "[joint.dynamics]\narmature = 0.01", table));
  CHECK(zoo.joints[3].limits.position_margin == 0.2);
  CHECK(zoo.joints[3].limits.effort_rate == 400);
  CHECK(zoo.joints[3].limits.damping == 1.5);
  CHECK(zoo.joints[9].limits.position_margin == 0);
  CHECK(std::isinf(zoo.joints[9].limits.effort_rate));
  CHECK(zoo.joints[9].limits.damping == 0);

  // the hip has [-1, 1.5]
  const auto refused = [&](const std::string& keys, const std::string& what) {
    Refused("[joint.dynamics]\narmature = 0.01",
            "[joint.limits]\n" + keys + "\n[joint.dynamics]\narmature = 0.01", what);
  };
  refused("position_margin = -0.1", "limits.position_margin");
  refused("position_margin = 1.26", "more than half");
  refused("effort_rate = 0", "limits.effort_rate");
  refused("damping = -1", "limits.damping");
  refused("damping = nan", "limits.damping");
  refused("dampng = 1", "did you mean damping?");
  Refused(
      "name = \"disc\"\nprotocol = \"cansimple\"\nnode = 2",
      "name = \"disc\"\nprotocol = \"cansimple\"\nnode = 2\n[joint.limits]\nposition_margin = 0.1",
      "the joint has none");
  Refused("name = \"spring\"\npassive = true",
          "name = \"spring\"\npassive = true\n[joint.limits]\ndamping = 1",
          "limits is of a motor, but the joint is passive");
}

TEST_CASE("what the driver watches, and how it stops") {
  using Stop = DriverSettings::Stop;
  const DriverSettings defaults = Load(kZooToml).driver;
  CHECK(defaults.stop == Stop::kZero);
  CHECK(defaults.max_motor_temperature == 90);
  CHECK(defaults.max_drive_temperature == 90);
  CHECK(defaults.min_bus_voltage == 0);
  CHECK(std::isinf(defaults.max_bus_voltage));
  CHECK(defaults.stuck_after == 0);

  const auto driver = [](const std::string& keys) {
    return Load(Replaced(kZooToml, "[driver]", "[driver]\n" + keys)).driver;
  };
  CHECK(driver("stop = \"zero\"").stop == Stop::kZero);
  const DriverSettings ramp = driver("stop = \"ramp\"\nramp = 0.15");
  CHECK(ramp.stop == Stop::kRamp);
  CHECK(ramp.ramp == 0.15);
  const DriverSettings limits = driver(
      "max_motor_temperature = 70\nmax_drive_temperature = inf\nmin_bus_voltage = "
      "20\nmax_bus_voltage = "
      "28\nstuck_after = 0.5");
  CHECK(limits.max_motor_temperature == 70);
  CHECK(std::isinf(limits.max_drive_temperature));
  CHECK(limits.min_bus_voltage == 20);
  CHECK(limits.max_bus_voltage == 28);
  CHECK(limits.stuck_after == 0.5);
  const std::string damped = Replaced(kZooToml, "[joint.dynamics]\narmature = 0.01",
                                      "[joint.limits]\ndamping = 2\n[joint.dynamics]");
  CHECK(Load(Replaced(damped, "[driver]", "[driver]\nstop = \"damping\"")).driver.stop ==
        Stop::kDamping);

  const auto refused = [](const std::string& keys, const std::string& what) {
    Refused("[driver]", "[driver]\n" + keys, what);
  };
  refused("stop = \"soft\"", "is not one of zero, ramp, damping");
  refused("stop = \"ramp\"", "driver.ramp is missing");
  refused("stop = \"ramp\"\nramp = 0.16", "disarmed before its end");  // 0.25 - 0.1
  refused("ramp = 0.1", "is for stop = \"ramp\" only");
  refused("stop = \"damping\"", "no joint has a damping");
  refused("max_motor_temperature = -1", "max_motor_temperature");
  refused("max_drive_temperature = nan", "max_drive_temperature");
  refused("min_bus_voltage = 30\nmax_bus_voltage = 28", "must be below max_bus_voltage");
  refused("stuck_after = -1", "stuck_after");
  refused("stuck_afer = 1", "did you mean stuck_after?");
}

TEST_CASE("a target per coordinate, and a spread") {
  const RobotDescription zoo = Load(kZooToml);
  // rail x, y, angle; hip; spring; free x, y, z, rotation; disc
  CHECK(zoo.task.target == std::vector<double>{-1, 0, 0, 0.5, 0, 0, 0, 0, 0.6, 0, 0.8, 0, 0});
  CHECK(zoo.task.spread == std::vector<double>{0, 0, 0, 0.2, 0, 0, 0, 0, 0.1, 0.1, 0.1, 0.1, 0});
  const std::string spread = "spread = {hip = 0.2, \"free/rotation\" = 0.1}";
  const RobotDescription even = Load(Replaced(kZooToml, spread, "spread = 0.3"));
  CHECK(even.task.spread == std::vector<double>(13, 0.3));
  const std::string target =
      "target = {hip = 0.5, \"rail/x\" = -1, \"free/rotation\" = [0.6, 0, 0.8, 0]}";
  const RobotDescription none = Load(Replaced(Replaced(kZooToml, target, ""), spread, ""));
  CHECK(none.task.target == std::vector<double>{0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0});
  CHECK(none.task.spread == std::vector<double>(13, 0.0));
}

TEST_CASE("warnings tell what does not touch the ground, if there is one") {
  // the thigh's mesh and cylinder; the base does not move
  CHECK(Load(kZooToml).warnings.size() == 2);
  const std::string contact =
      "[simulation.contact]\nstiffness = 20000.0\ndamping = 100.0\nfriction = 0.8\nslip_speed = "
      "0.01\n";
  const RobotDescription floating = Load(Replaced(kZooToml, contact, ""));
  CHECK(floating.warnings.empty());
  CHECK_FALSE(floating.simulation.contact);
}

TEST_CASE("a part of a planar joint may have a motor") {
  const std::string motor =
      "[[joint]]\nname = \"rail/x\"\nprotocol = \"cansimple\"\nnode = 3\n[estimator]";
  const std::string toml = Replaced(kZooToml, "[estimator]", motor);
  CHECK_THROWS_WITH(Load(toml),
                    Contains("robot.urdf:42: joint rail/x: limit effort must be positive"));
  const std::string urdf = Replaced(kZooUrdf, "<axis xyz=\"0 0 3\"/>",
                                    "<axis xyz=\"0 0 3\"/><limit effort=\"7\" velocity=\"1\"/>");
  const RobotDescription zoo = Load(toml, urdf);
  CHECK(zoo.driven() == std::vector<int>{0, 3, 9});
  CHECK(zoo.joints[0].effort_limit == 7);
  CHECK(zoo.joints[1].effort_limit == 0);
}

TEST_CASE("mistakes about joints are at their lines") {
  Refused("node = 2", "node = 1", "37:8: joint[2].node = 1 is also joint hip's");
  Refused("passive = true", "", "joint[1].protocol is missing");
  Refused("passive = true", "passive = 1", "31:11: joint[1].passive is not true or false");
  Refused("passive = true", "passive = true\ngear = 2.0",
          "32:8: joint[1].gear is of a motor, but the joint is passive");
  Refused("passive = true\n[joint.dynamics]", "passive = true\n[joint.dynamics]\ndelay = 0.1",
          "33:9: joint[1].dynamics.delay needs a motor");
  Refused("[[joint]]\nname = \"spring\"\npassive = true\n[joint.dynamics]\nstiffness = 5000.0\n",
          "", "joint \"spring\" of the URDF is driven, or passive = true");
  Refused("name = \"disc\"", "name = \"free/rotation\"",
          "\"free/rotation\" is a spherical joint, which no motor drives");
  Refused("[estimator]",
          "[[joint]]\nname = \"free/rotation\"\npassive = true\n[joint.dynamics]\nrest = "
          "1.0\n[estimator]",
          "rest has no meaning for a spherical joint");
  for (const char* key : {"stiffness", "sensor_delay", "sensor_bias"}) {
    Refused("[estimator]",
            std::string("[[joint]]\nname = \"free/rotation\"\npassive = true\n[joint.dynamics]\n") +
                key + " = 0.1\n[estimator]",
            std::string(key) + " has no meaning for a spherical joint");
  }
  for (const char* key : {"motor_gain", "delay", "no_load_speed"}) {
    Refused("[estimator]",
            std::string("[[joint]]\nname = \"free/rotation\"\npassive = true\n[joint.dynamics]\n") +
                key + " = 0.1\n[estimator]",
            std::string(key) + " needs a motor");
  }
  // The simulator remembers no further back.
  Refused("delay = 0.004", "delay = 0.51", "delay = 0.51 is not in [0, 0.5]");
  Refused("sensor_delay = 0.002", "sensor_delay = 0.51", "sensor_delay = 0.51 is not in [0, 0.5]");
  CHECK_NOTHROW(Load(Replaced(kZooToml, "sensor_delay = 0.002", "sensor_delay = 0.5")));
  Refused("name = \"disc\"", "name = \"free\"", "\"free\" is not a moving joint");
  Refused("name = \"disc\"", "name = \"weld\"", "name = \"weld\" is fixed: a joint that does not");
  Refused("armature = 0.01", "armature = -0.01", "20:12: joint[0].dynamics.armature");
  Refused("rest = 0.1", "rset = 0.1", "rset is not a known key; did you mean rest?");
  Refused("no_load_speed = 12.0", "no_load_speed = 0.0", "28:17: joint[0].dynamics.no_load_speed");
  Refused("motor_gain = 0.9", "motor_gain = inf", "24:14: joint[0].dynamics.motor_gain");
  Refused("slip_speed = 0.01", "slip_speed = 0", "simulation.contact.slip_speed");
  Refused("slip_speed = 0.01", "slipspeed = 0.01", "did you mean slip_speed?");
  Refused("[simulation.limit]", "[simulation.limits]", "did you mean limit?");
  Refused("stiffness = 500.0\ndamping = 5.0", "stiffness = 500.0\ndamping = -5.0",
          "simulation.limit.damping");
  Refused("\"mass/thigh\" = [0.9, 1.1]", "\"damping/hip\" = [0.9, 1.1]",
          "damping/hip is not one of the parameters");
}

TEST_CASE("mistakes about targets are at their lines") {
  Refused("hip = 0.5", "hipp = 0.5", "task.target.hipp is not a known key; did you mean hip?");
  for (const std::string table : {"target", "spread"}) {
    Refused(table + " = {", table + " = {weld = 0, ",
            "task." + table + ".weld is fixed: it does not move");
  }
  Refused("hip = 0.5", "hip = 1.6", "task.target.hip = 1.6 is beyond the joint's limits [-1, 1.5]");
  Refused("hip = 0.5", "hip = nan", "task.target.hip");
  Refused("[0.6, 0, 0.8, 0]", "[0.6, 0, 0.7, 0]", "is not a unit quaternion");
  Refused("[0.6, 0, 0.8, 0]", "[0.6, 0.8, 0]", "has 3 numbers, not 4");
  Refused("[0.6, 0, 0.8, 0]", "1", "is not an array of numbers");
  Refused("spread = {hip = 0.2", "spread = {hip = -0.2", "task.spread.hip");
  Refused("spread = {hip = 0.2", "spread = {knee = 0.2", "task.spread.knee is not a known key");
  Refused("spread = {hip = 0.2, \"free/rotation\" = 0.1}", "spread = \"wide\"",
          "task.spread is not a number");
}

TEST_CASE("a robot of passive joints only is none") {
  std::string toml =
      Replaced(kZooToml, "[[joint]]\nname = \"disc\"\nprotocol = \"cansimple\"\nnode = 2",
               "[[joint]]\nname = \"disc\"\npassive = true");
  const size_t begin = toml.find("protocol"), end = toml.find("[joint.dynamics]");
  toml.replace(begin, end - begin, "passive = true\n");
  for (const char* key : {"motor_gain = 0.9\n", "delay = 0.004\n", "no_load_speed = 12.0\n"})
    toml = Replaced(toml, key, "");
  CHECK_THROWS_WITH(Load(toml), Contains("joint drives no joint: all are passive"));
}

}  // namespace
}  // namespace plumb
