#include "robot/settings/virtual_robot.h"

#include <fmt/format.h>

#include <algorithm>

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

}  // namespace

VirtualRobotSettings ReadVirtualRobot(Config config, const RobotDescription& robot) {
  VirtualRobotSettings s;
  s.watchdog = config.Number("watchdog", {0, 10});
  s.heartbeat = config.Number("heartbeat", {1e-3, 10});
  s.encoder_bits = config.Integer("encoder_bits", {4, 32});
  s.engine =
      static_cast<VirtualRobotSettings::Engine>(config.Choice("engine", {"auto", "mujoco"}, 0));
  s.engine_source = config.Position("engine");
  Config hidden = config.Table("hidden", false);
  for (const std::string& name : hidden.Keys()) {
    const std::vector<double> bounds = hidden.Numbers(name, 2, {-1e12, 1e12});
    if (!(bounds[0] <= bounds[1])) hidden.Fail(name, "must be [lower, upper]");
    if (robot.FindParameter(name) < 0) hidden.Fail(name, "is not one of the parameters");
    s.hidden.push_back({name, bounds[0], bounds[1]});
  }
  for (Config& joint : config.Tables("joint"))
    s.joints.push_back(ReadUnmodelledJoint(joint, robot, s.joints));
  config.Finish();
  return s;
}

}  // namespace plumb
