#include "robot/description.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numbers>

#include "common/config.h"
#include "robot/urdf/urdf.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Catch::Contains;
using Catch::EndsWith;

const std::string kRobots = std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots",
                  kPendulum = kRobots + "/pendulum";

std::string Text(const std::string& file) {
  std::ifstream stream(file);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

// A copy of the pendulum with one text replaced in one file; removed again at the end.
class Edited {
 public:
  Edited(const std::string& file, const std::string& from, const std::string& to) {
    fs::copy(kPendulum, folder_.path());
    std::string text = Text(kPendulum + "/" + file);
    const auto at = text.find(from);
    REQUIRE(at != std::string::npos);
    text.replace(at, from.size(), to);
    std::ofstream(folder_ / file) << text;
  }
  std::string path() const { return folder_.path(); }

 private:
  TemporaryFolder folder_;
};

TEST_CASE("impacts and coupling of the estimator are read and checked") {
  const Edited good("robot.toml", "[estimator]\n",
                    "[estimator]\nground_impact = 9.0\nstop_impact = 70.0\ncoupling = 0.1\n");
  const EstimatorSettings settings = LoadRobot(good.path()).estimator;
  CHECK(settings.ground_impact == 9);
  CHECK(settings.stop_impact == 70);
  CHECK(settings.coupling == 0.1);
  CHECK(LoadRobot(kPendulum).estimator.stop_impact == 0);
  CHECK(LoadRobot(kPendulum).estimator.coupling == 1);
  for (const std::string key : {"ground_impact = -1.0", "stop_impact = -1.0", "coupling = 1.5"}) {
    const Edited bad("robot.toml", "[estimator]\n", "[estimator]\n" + key + "\n");
    CHECK_THROWS_WITH(LoadRobot(bad.path()), Contains(key.substr(0, key.find(' '))));
  }
}

TEST_CASE("a joint that robot.toml holds must be one of the URDF's") {
  const auto with = [](const std::string& fixed) {
    return Edited("robot.toml", "urdf = ", "fixed = " + fixed + "\nurdf = ");
  };
  CHECK_THROWS_WITH(LoadRobot(with("[\"pivott\"]").path()),
                    Contains("robot.toml:") && Contains("fixed = \"pivott\" is not a moving joint "
                                                        "of the URDF; did you mean pivot?"));
  CHECK_THROWS_WITH(LoadRobot(with("[\"pivot\"]").path()), Contains("has no moving joint"));
  CHECK_THROWS_WITH(LoadRobot(with("3").path()), Contains("fixed is not an array of texts"));
  CHECK_THROWS_WITH(LoadRobot(with("[3]").path()), Contains("fixed is not an array of texts"));
  CHECK(LoadRobot(with("[]").path()).num_joints() == 1);
}

TEST_CASE("what a parameter names in full is not given by one that covers it") {
  RobotDescription robot = LoadRobot(kPendulum);
  robot.parameters = {{"friction/*_hip", "Nm", ParameterDescription::Coordinate::kLog, 1, 1},
                      {"mass/trunk", "kg", ParameterDescription::Coordinate::kLog, 1, 1}};
  robot.frozen = {{"friction/left_hip", 0.1}, {"mass/*", 1}};
  CHECK(robot.ParameterOf("friction/right_hip") == "friction/*_hip");
  CHECK(robot.ParameterOf("friction/left_hip") == "friction/left_hip");
  CHECK(robot.ParameterOf("mass/trunk") == "mass/trunk");
  CHECK(robot.ParameterOf("mass/calf") == "mass/*");
  CHECK(robot.ParameterOf("friction/knee").empty());
  CHECK(robot.IsUncertain("friction/right_hip"));
  CHECK_FALSE(robot.IsUncertain("friction/left_hip"));
  CHECK_FALSE(robot.IsUncertain("mass/calf"));
  CHECK_FALSE(robot.IsUncertain("mass/a/b"));  // a wildcard does not reach beyond a slash
}

TEST_CASE("a joint's entries of q and v begin behind those of the joints before it") {
  const RobotDescription quadruped = LoadRobot(kRobots + "/quadruped");
  REQUIRE(quadruped.num_joints() == 16);
  REQUIRE(quadruped.joints[3].type == JointDescription::Type::kSpherical);
  for (int i = 0; i < quadruped.num_joints(); ++i) {
    CHECK(quadruped.position_of(i) == (i <= 3 ? i : i + 3));
    CHECK(quadruped.velocity_of(i) == (i <= 3 ? i : i + 2));
  }
  CHECK(quadruped.num_positions() == 19);
  CHECK(quadruped.num_velocities() == 18);

  const RobotDescription hopper = LoadRobot(kRobots + "/hopper");
  REQUIRE(hopper.num_joints() == 6);
  for (int i = 0; i < hopper.num_joints(); ++i) {
    CHECK(hopper.position_of(i) == i);
    CHECK(hopper.velocity_of(i) == i);
  }
  CHECK(hopper.num_positions() == 6);
  CHECK(hopper.num_velocities() == 6);
}

TEST_CASE("the hung quadruped is its legs alone") {
  const fs::path folder = fs::path(kPendulum).parent_path() / "quadruped";
  const RobotDescription whole = LoadRobot(folder), hung = LoadRobot(folder / "hung.toml");
  CHECK(hung.num_joints() == 12);
  CHECK(hung.num_positions() == 12);
  CHECK(whole.num_positions() == 19);
  REQUIRE(hung.parameters.size() == 48);
  CHECK(hung.virtual_robot.hidden.size() == 48);
  CHECK_FALSE(hung.simulation.contact);
  for (size_t i = 0; i < 12; ++i) {
    const JointDescription &own = hung.joints[i], &joint = whole.joints[i + 4];
    CHECK(own.name == joint.name);
    CHECK(own.dynamics.kp == 25);
    CHECK(own.dynamics.rest == joint.dynamics.rest);
    CHECK(hung.task.target[i] == joint.dynamics.rest);
    CHECK(hung.links[i + 1].mass == whole.links[i + 5].mass);
  }
}

TEST_CASE("the pendulum is read whole") {
  const RobotDescription robot = LoadRobot(kPendulum);
  CHECK(robot.name == "pendulum");
  REQUIRE(robot.num_joints() == 1);
  const JointDescription& joint = robot.joints[0];
  CHECK(joint.type == JointDescription::Type::kContinuous);
  CHECK(joint.axis == Eigen::Vector3d::UnitY());
  CHECK(joint.effort_limit == 2);
  CHECK(std::isinf(joint.upper));
  CHECK(joint.motor.protocol == "cansimple");
  REQUIRE(robot.links.size() == 2);
  CHECK(robot.links[1].mass == 1);
  CHECK(robot.links[1].center_of_mass == Eigen::Vector3d(0, 0, 0.5));
  CHECK(robot.links[1].inertia(1, 1) == Approx(1.0 / 12));
  CHECK(robot.FindParameter("length/pole") == 2);
  CHECK(robot.FindParameter("nonsense") == -1);
  CHECK(robot.training.hidden == std::vector<int>{128, 128});
  CHECK(LoadRobot(kPendulum + "/robot.toml").name == "pendulum");
}

TEST_CASE("the log-normal prior has the mean and variance asked for") {
  const ParameterDescription p = LoadRobot(kPendulum).parameters[1];
  const double m = p.coordinate_mean(), s2 = p.coordinate_variance();
  CHECK(std::exp(m + s2 / 2) == Approx(1.04));
  CHECK(std::expm1(s2) * std::exp(2 * m + s2) == Approx(0.033));
  CHECK(p.ToCoordinate(p.ToPhysical(0.3)) == Approx(0.3));
}

TEST_CASE(
    "what a virtual robot has and no model knows is read, and refused where it makes no sense") {
  const RobotDescription worn = LoadRobot(kPendulum + "/worn.toml");
  REQUIRE(worn.virtual_robot.joints.size() == 1);
  const UnmodelledJoint& pivot = worn.virtual_robot.joints[0];
  CHECK(pivot.joint == 0);
  CHECK(pivot.friction == 0.1);
  CHECK(pivot.delay == 0.004);
  CHECK(pivot.backlash == 0.003);
  CHECK(pivot.rotor == 0.01);
  CHECK(worn.virtual_robot.engine == VirtualRobotSettings::Engine::kAuto);
  CHECK(worn.fingerprint != LoadRobot(kPendulum).fingerprint);
  CHECK(LoadRobot(kPendulum + "/worn_fitted.toml").parameters.size() == worn.parameters.size() + 2);
  const RobotDescription mujoco = LoadRobot(kPendulum + "/../hopper/mujoco.toml");
  CHECK(mujoco.virtual_robot.engine == VirtualRobotSettings::Engine::kMujoco);
  CHECK_THAT(mujoco.virtual_robot.engine_source, Contains("mujoco.toml:6:10: "));

  const auto refused = [](const std::string& line, const std::string& why) {
    const Edited robot("worn.toml", "rotor = 0.01            # [kg m^2] before it", line);
    CHECK_THROWS_WITH(LoadRobot(robot.path() + "/worn.toml"),
                      Contains("worn.toml:") && Contains(why));
  };
  refused("", "virtual_robot.joint[0].rotor is missing");
  refused("rotor = 0", "virtual_robot.joint[0].rotor = 0 is not");
  refused("rotor = 0.01\nmass = 1", "virtual_robot.joint[0].mass is not a known key");
  refused("rotor = 0.01\n[[virtual_robot.joint]]\nname = \"pivot\"", "occurs twice");
  refused("rotor = 0.01\n[[virtual_robot.joint]]\nname = \"pole\"",
          "\"pole\" is not a joint with a motor");
  refused("rotor = 0.01\n[virtual_robot]\nengine = \"bullet\"",
          "is not one of auto, mujoco, simbody, ode");
  refused("rotor = 0.01\n[virtual_robot.ground]\nfriction = 1",
          "virtual_robot.ground.friction is of a ground that the robot does not touch");
}

TEST_CASE("a ground and sprung masses that no model knows are read, and refused likewise") {
  const std::string folder = kPendulum + "/../hopper/";
  const RobotDescription worn = LoadRobot(folder + "worn.toml");
  CHECK(worn.virtual_robot.engine == VirtualRobotSettings::Engine::kMujoco);
  REQUIRE(worn.virtual_robot.joints.size() == 3);
  CHECK(worn.virtual_robot.joints[1].backlash == 0.003);
  REQUIRE(worn.virtual_robot.sprung_masses.size() == 1);
  const SprungMass& battery = worn.virtual_robot.sprung_masses[0];
  CHECK(worn.links[static_cast<size_t>(battery.link)].name == "torso");
  CHECK(battery.mass == 0.5);
  CHECK(battery.frequency == 5);
  CHECK(battery.damping_ratio == 0.1);
  CHECK(battery.axis == Eigen::Vector3d::UnitZ());
  CHECK(battery.travel == 0.05);
  CHECK(LoadRobot(folder + "simbody.toml").virtual_robot.engine ==
        VirtualRobotSettings::Engine::kSimbody);
  CHECK(LoadRobot(folder + "ode.toml").virtual_robot.engine == VirtualRobotSettings::Engine::kOde);
  CHECK(LoadRobot(folder + "mujoco_stiff.toml").virtual_robot.ground.stiffness_factor == 5);
  CHECK(LoadRobot(folder + "mujoco_slippery.toml").virtual_robot.ground.friction == 0.7);
  const UnmodelledGround slope = LoadRobot(folder + "mujoco_slope.toml").virtual_robot.ground;
  CHECK(slope.slope == Approx(3 * std::numbers::pi / 180));
  // Uphill is forward: it pulls back.
  CHECK(slope.Down()[0] == Approx(-std::sin(slope.slope)));
  CHECK(slope.Down().norm() == Approx(1));
  CHECK(worn.virtual_robot.ground.Down() == -Eigen::Vector3d::UnitZ());

  const TemporaryFolder copies;
  fs::copy(folder, copies.path());
  const auto refused = [&](const std::string& text, const std::string& why) {
    std::ofstream(copies / "other.toml") << "extends = \"robot.toml\"\n" << text;
    CHECK_THROWS_WITH(LoadRobot(copies / "other.toml"), Contains("other.toml:") && Contains(why));
  };
  const std::string ground = "[virtual_robot.ground]\n";
  refused(ground + "slope = 0.1", "virtual_robot.ground.slope needs engine = \"mujoco\", ");
  refused(ground + "slope = 1.6", "virtual_robot.ground.slope = 1.6 is not");
  refused(ground + "stiffness_factor = 0", "virtual_robot.ground.stiffness_factor = 0 is not");
  refused(ground + "friction = -1", "virtual_robot.ground.friction = -1 is not");
  refused(ground + "stiffnes_factor = 5", "virtual_robot.ground.stiffnes_factor is not a known");
  const std::string mass =
      "[[virtual_robot.sprung_mass]]\nname = \"a\"\nmass = 1\ndamping_ratio = 0.1\n"
      "centre = [0, 0, 0]\n";
  const std::string rest = "link = \"torso\"\nfrequency = 5\naxis = [0, 0, 1]\n";
  refused(mass + "link = \"world\"", "link = \"world\" is not a link that moves");
  refused(mass + "link = \"torso\"\nfrequency = 0", "sprung_mass[0].frequency = 0 is not");
  refused(mass + "link = \"torso\"\nfrequency = 5\naxis = [0, 0, 0]", "axis has no direction");
  refused(mass + rest + "travel = 0", "sprung_mass[0].travel = 0 is not");
}

TEST_CASE("mistakes in robot.toml are one line with file, line and field") {
  const auto message = [](const std::string& from, const std::string& to) {
    const Edited robot("robot.toml", from, to);
    try {
      LoadRobot(robot.path());
    } catch (const ConfigError& error) {
      const std::string text = error.what();
      CHECK(text.find('\n') == std::string::npos);
      CHECK_THAT(text, Contains("robot.toml:"));
      return text;
    }
    return std::string("no error");
  };
  CHECK_THAT(message("expiry = 0.1", "expirey = 0.1"),
             Contains("robot.toml:13:11: driver.expirey is not a known key; did you mean expiry?"));
  CHECK_THAT(message("expiry = 0.1", ""), Contains("robot.toml:10:1: driver.expiry is missing"));
  CHECK_THAT(message("latency =", "latencey ="),
             Contains("latencey is not a known key; did you mean latency?"));
  CHECK_THAT(message("node = 1", "node = \"1\""), Contains("joint[0].node is not an integer"));
  CHECK_THAT(message("name = \"pivot\"", "name = \"pivto\""),
             Contains("\"pivto\" is not a moving joint of the URDF; the nearest is 'pivot'"));
  CHECK_THAT(message("[[joint]]", "[[jonit]]"),
             Contains("jonit is not a known key; did you mean joint?"));
  CHECK_THAT(message("variance = 0.33", "variance = -0.33"), Contains("parameter[0].variance"));
  CHECK_THAT(message("disarm_after = 0.25", "disarm_after = 0.05"),
             Contains("disarm_after must not be shorter"));
  CHECK_THAT(message("coordinate = \"log\"", "coordinate = \"logg\""),
             Contains("is not one of linear, log"));
  CHECK_THAT(message("gravity = [9.0, 11.0]", "gravty = [9.0, 11.0]"),
             Contains("gravty is not one of the parameters; the nearest is 'gravity'"));
  CHECK_THAT(message("[task]", "[tsk]"), Contains("tsk is not a known key; did you mean task?"));
  CHECK_THAT(message("substep = 0.005", "substep = nan"), Contains("simulation.substep"));
  CHECK_THAT(message("steps = 200", "steps = 1e99"), Contains("task.steps"));
  CHECK_THAT(message("gear = 1.0", "gear = 0.0"), Contains("gear"));
  CHECK_THAT(message("[robot]", "[robot"), Contains("robot.toml:3:"));
  CHECK_THAT(message("robot.urdf\"", "robot.xml\""),
             Contains("robot.toml:5:8: robot.urdf = \"robot.xml\": there is no such file: ") &&
                 EndsWith("/robot.xml") && !Contains("/robot.xml,"));
}

TEST_CASE("a URDF is beside the robot's file, else beside the one that it extends") {
  const TemporaryFolder folder;
  fs::copy(kPendulum, folder / "base");
  fs::create_directory(folder / "own");
  const std::string own = folder / "own/robot.toml", urdf = folder / "base/robot.urdf",
                    beside = folder / "own/robot.urdf";
  std::ofstream(own) << "extends = \"../base/robot.toml\"\n[task]\nsteps = 7\n";
  CHECK(LoadRobot(own).task.steps == 7);
  Config header = Config::Load(own).Table("robot");
  CHECK(fs::equivalent(FindUrdf(header), urdf));
  CHECK(fs::path(header.FileOf("urdf")).parent_path().filename() == "base");
  CHECK(header.FileOf("nothing") == own);

  // Its own comes first.
  fs::copy(urdf, beside);
  CHECK(fs::equivalent(FindUrdf(header), beside));
  fs::remove(urdf);
  CHECK(fs::equivalent(FindUrdf(header), beside));
  CHECK(LoadRobot(own).num_joints() == 1);

  fs::remove(beside);
  CHECK_THROWS_WITH(LoadRobot(own), Contains("base/robot.toml:5:8: robot.urdf = \"robot.urdf\": "
                                             "there is no such file: ") &&
                                        Contains(beside + ", ") && EndsWith("/base/robot.urdf"));
}

TEST_CASE("mistakes in robot.urdf name the file and the element") {
  const auto message = [](const std::string& from, const std::string& to) {
    const Edited robot("robot.urdf", from, to);
    try {
      LoadRobot(robot.path());
    } catch (const ConfigError& error) {
      CHECK_THAT(error.what(), Contains("robot.urdf:"));
      return std::string(error.what());
    }
    return std::string("no error");
  };
  CHECK_THAT(message("mass value=\"1.0\"", "mass value=\"-1\""), Contains("link pole: mass"));
  CHECK_THAT(message("izz=\"0\"", "izz=\"1\""), Contains("no body can have this inertia"));
  CHECK_THAT(message("effort=\"2.0\"", "effort=\"0\""), Contains("joint pivot: limit effort"));
  CHECK_THAT(message("<parent link=\"base\"/>", "<parent link=\"bse\"/>"), Contains("bse"));
  CHECK_THAT(message("type=\"continuous\"", "type=\"helical\""),
             Contains("joint pivot is not fixed"));
  CHECK_THAT(message("</robot>", ""), Contains("robot.urdf"));
  CHECK_THROWS_WITH(LoadRobot("/nowhere"), Contains("there is no such robot"));
  CHECK_THROWS_WITH(LoadRobot(kRobots + "/pendulm"),
                    EndsWith("; did you mean " + kRobots + "/pendulum?"));
  CHECK_THROWS_WITH(LoadRobot(kRobots + "/hopper/mujco.toml"), EndsWith("/hopper/mujoco.toml?"));
  CHECK_THROWS_WITH(LoadRobot("none/arm"),
                    EndsWith("seen from " + std::filesystem::current_path().string()));
  CHECK_THROWS_WITH(LoadRobot(kRobots + "/pendulum/robot.urdf"), Contains("is a URDF"));
}

}  // namespace
}  // namespace plumb
