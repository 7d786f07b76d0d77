#include "dashboard/robot_json.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "common/program_version.h"
#include "dashboard/channels.h"
#include "robot/coordinate_names.h"

namespace plumb {
namespace {

using nlohmann::ordered_json;
using Type = JointDescription::Type;

const char* Name(Type type) {
  switch (type) {
    case Type::kRevolute:
      return "revolute";
    case Type::kContinuous:
      return "continuous";
    case Type::kPrismatic:
      return "prismatic";
    case Type::kSpherical:
      return "spherical";
  }
  return "";
}

ordered_json FiniteOrNull(double number) {
  return std::isfinite(number) ? ordered_json(number) : ordered_json();
}

ordered_json Joint(const JointDescription& joint) {
  const bool slides = joint.type == Type::kPrismatic;
  const bool has_effort = !joint.passive && joint.effort_limit > 0;
  return {{"name", joint.name},
          {"type", Name(joint.type)},
          {"unit_position", slides                           ? "m"
                            : joint.type == Type::kSpherical ? "1"
                                                             : "rad"},
          {"unit_velocity", slides ? "m/s" : "rad/s"},
          {"unit_effort", slides ? "N" : "Nm"},
          {"lower", FiniteOrNull(joint.lower)},
          {"upper", FiniteOrNull(joint.upper)},
          {"effort", has_effort ? ordered_json(joint.effort_limit) : ordered_json()},
          {"velocity", FiniteOrNull(joint.velocity_limit)}};
}

/// The next so many entries of q or of v, which are a joint's.
void AppendEntries(const std::vector<std::string>& names, int count, const char* unit,
                   ordered_json& entries) {
  for (int i = 0; i < count; ++i) {
    entries.push_back({{"name", names[entries.size()]}, {"unit", unit}});
  }
}

}  // namespace

std::string RobotJson(const RobotDescription& robot, const std::string& why_not) {
  ordered_json joints = ordered_json::array(), coordinates = joints, velocities = joints,
               parameters = joints, channels = joints;
  const CoordinateNames names(robot);
  for (const JointDescription& joint : robot.joints) {
    joints.push_back(Joint(joint));
    const bool slides = joint.type == Type::kPrismatic;
    AppendEntries(names.q, joint.num_positions(),
                  slides                       ? "m"
                  : joint.num_positions() == 1 ? "rad"
                                               : "1",
                  coordinates);
    AppendEntries(names.v, joint.num_velocities(), slides ? "m/s" : "rad/s", velocities);
  }
  for (const ParameterDescription& parameter : robot.parameters) {
    parameters.push_back({{"name", parameter.name},
                          {"unit", parameter.unit},
                          {"prior_mean", parameter.mean},
                          {"prior_sd", std::sqrt(parameter.variance)}});
  }
  for (const ChannelOfPage& channel : ChannelsOfPage()) channels.push_back(channel.name);
  const ordered_json json{
      {"name", robot.name},
      {"version", ProgramVersion()},
      {"joints", joints},
      {"coordinates", coordinates},
      {"velocities", velocities},
      {"parameters", parameters},
      {"task",
       {{"name", robot.task.name}, {"period", robot.task.period}, {"steps", robot.task.steps}}},
      {"channels", channels},
      {"may_control", why_not.empty()},
      {"why_not", why_not}};
  return json.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

}  // namespace plumb
