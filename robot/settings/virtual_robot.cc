#include "robot/settings/virtual_robot.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/nearest_name.h"
#include "robot/description.h"

namespace plumb {
namespace {

UnmodelledJoint ReadUnmodelledJoint(Config& config, const RobotDescription& robot,
                                    const std::vector<UnmodelledJoint>& before) {
  UnmodelledJoint s;
  const std::string name = config.String("name");
  for (const int i : robot.driven()) {
    if (robot.joints[static_cast<size_t>(i)].name == name) s.joint = i;
  }
  if (s.joint < 0) config.Fail("name", fmt::format("= \"{}\" is not a joint with a motor", name));
  if (std::any_of(before.begin(), before.end(),
                  [&](const auto& other) { return other.joint == s.joint; })) {
    config.Fail("name", fmt::format("= \"{}\" occurs twice", name));
  }
  s.friction = config.Number("friction", {0, 1e9}, 0);
  s.delay = config.Number("delay", {0, JointDynamics::kLongestDelay}, 0);
  s.backlash = config.Number("backlash", {0, 1e3}, 0);
  if (s.backlash > 0) {
    s.rotor = config.Number("rotor", {1e-9, 1e9});
  } else if (config.Has("rotor")) {
    config.Fail(
        "rotor",
        "is what backlash parts from its joint, and there is none; without it write armature");
  }
  config.Finish();
  return s;
}

UnmodelledGround ReadUnmodelledGround(Config config, const RobotDescription& robot,
                                      VirtualRobotSettings::Engine engine) {
  UnmodelledGround s;
  const std::vector<std::string> keys = config.Keys();
  s.stiffness_factor = config.Number("stiffness_factor", {1e-3, 1e3}, 1);
  if (config.Has("friction")) s.friction = config.Number("friction", {0, 1e3});
  s.slope = config.Number("slope", {-0.785, 0.785}, 0);
  config.Finish();
  if (!keys.empty() && !robot.simulation.contact)
    config.Fail(keys.front(),
                "is of a ground that the robot does not touch: there is no "
                "[simulation.contact]");
  if (s.slope != 0 && engine == VirtualRobotSettings::Engine::kAuto)
    config.Fail(
        "slope",
        "needs engine = \"mujoco\", \"simbody\" or \"ode\": the simulator's ground is level");
  return s;
}

SprungMass ReadSprungMass(Config& config, const RobotDescription& robot,
                          const std::vector<SprungMass>& before) {
  SprungMass s;
  s.name = config.String("name");
  if (std::any_of(before.begin(), before.end(),
                  [&](const auto& other) { return other.name == s.name; })) {
    config.Fail("name", fmt::format("= \"{}\" occurs twice", s.name));
  }
  const std::string link = config.String("link");
  const auto found = std::find_if(robot.links.begin() + 1, robot.links.end(),
                                  [&](const auto& other) { return other.name == link; });
  if (found == robot.links.end())
    config.Fail("link", fmt::format("= \"{}\" is not a link that moves", link));
  s.link = static_cast<int>(found - robot.links.begin());
  s.mass = config.Number("mass", {1e-6, 1e9});
  s.frequency = config.Number("frequency", {1e-3, 1e3});
  s.damping_ratio = config.Number("damping_ratio", {0, 1e3});
  const std::vector<double> axis = config.Numbers("axis", 3, {-1e6, 1e6});
  s.axis = Eigen::Vector3d(axis[0], axis[1], axis[2]);
  if (s.axis.isZero(1e-6)) config.Fail("axis", "has no direction");
  s.axis.normalize();
  const std::vector<double> centre = config.Numbers("centre", 3, {-1e3, 1e3});
  s.centre = Eigen::Vector3d(centre[0], centre[1], centre[2]);
  s.travel = config.Number("travel", {1e-6, 1e3}, std::numeric_limits<double>::infinity());
  if (std::isfinite(s.travel) && !robot.simulation.stop)
    config.Fail("travel", "ends at stops, and there is no [simulation.limit]");
  config.Finish();
  return s;
}

// Which of the two is misspelt is for the reader to see.
std::string NoParameter(const std::string& name, const RobotDescription& robot) {
  std::vector<std::string> names;
  for (const ParameterDescription& parameter : robot.parameters) names.push_back(parameter.name);
  std::string text = "is not one of the parameters";
  if (!names.empty()) text += "; the nearest is '" + NearestName(name, names) + "'";
  return text;
}

}  // namespace

Eigen::Vector3d UnmodelledGround::Down() const {
  return {0 - std::sin(slope), 0, -std::cos(slope)};  // 0 - 0 is not -0
}

VirtualRobotSettings ReadVirtualRobot(Config config, const RobotDescription& robot) {
  VirtualRobotSettings s;
  s.watchdog = config.Number("watchdog", {0, 10});
  s.heartbeat = config.Number("heartbeat", {1e-3, 10});
  s.encoder_bits = config.Integer("encoder_bits", {4, 32});
  s.engine = static_cast<VirtualRobotSettings::Engine>(
      config.Choice("engine", {"auto", "mujoco", "simbody", "ode"}, 0));
  s.engine_source = config.Position("engine");
  Config hidden = config.Table("hidden", false);
  for (const std::string& name : hidden.Keys()) {
    const std::vector<double> bounds = hidden.Numbers(name, 2, {-1e12, 1e12});
    if (!(bounds[0] <= bounds[1])) hidden.Fail(name, "must be [lower, upper]");
    if (robot.FindParameter(name) < 0) hidden.Fail(name, NoParameter(name, robot));
    s.hidden.push_back({name, bounds[0], bounds[1]});
  }
  for (Config& joint : config.Tables("joint"))
    s.joints.push_back(ReadUnmodelledJoint(joint, robot, s.joints));
  s.ground = ReadUnmodelledGround(config.Table("ground", false), robot, s.engine);
  for (Config& mass : config.Tables("sprung_mass"))
    s.sprung_masses.push_back(ReadSprungMass(mass, robot, s.sprung_masses));
  config.Finish();
  return s;
}

}  // namespace plumb
