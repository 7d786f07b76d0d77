#include "drivers/protocols/known_protocols.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "common/nearest_name.h"
#include "common/small_letters.h"
#include "drivers/protocols/registry.h"
#include "robot/place_in_file.h"

namespace plumb {
namespace {

struct Maker {
  std::string_view name, protocol;
};
// What people write who know the maker, or the motor.
constexpr Maker kMakers[] = {
    {"odrive", "cansimple"}, {"mjbots", "moteus"},    {"myactuator", "rmd"}, {"cubemars", "mit"},
    {"t-motor", "mit"},      {"mini-cheetah", "mit"}, {"canopen", "cia406"}, {"mti", "xsens"},
};

constexpr size_t kAlike = 2;  // letters that may differ

/// "; did you mean ...?" and the like, where there is an idea. @param known not empty.
std::string Meant(std::string_view name, const std::vector<std::string>& known) {
  const std::string small = InSmallLetters(name);
  for (const Maker& maker : kMakers) {
    const std::string protocol(maker.protocol);
    if (small == maker.name && std::ranges::find(known, protocol) != known.end())
      return fmt::format("; {} speaks {}", name, protocol);
  }
  if (small == "canopen" || small.starts_with("cia"))
    return "; of CANopen, encoders (cia406) are supported, drives (CiA 402) are not";
  const std::string& nearest = NearestName(small, known);
  return EditDistance(small, nearest) <= kAlike ? fmt::format("; did you mean {}?", nearest) : "";
}

/// @param kind "motor" or "sensor". @param table, name the entry of the robot's file.
void Require(const RobotDescription& robot, const std::string& protocol,
             const std::vector<std::string>& known, const char* kind, const std::string& table,
             const std::string& name) {
  if (std::ranges::find(known, protocol) != known.end()) return;
  throw std::invalid_argument(fmt::format(
      "{}{} {}: unknown {} protocol '{}'; known: {}{}", PlaceInFile(robot, table, name, "protocol"),
      table, name, kind, protocol, fmt::join(known, ", "), Meant(protocol, known)));
}

}  // namespace

void RequireProtocols(const RobotDescription& robot) {
  for (const int i : robot.driven()) {
    const JointDescription& joint = robot.joints[static_cast<size_t>(i)];
    Require(robot, joint.motor.protocol, MotorProtocols(), "motor", "joint", joint.name);
  }
  for (const SensorDescription& sensor : robot.sensors)
    Require(robot, sensor.protocol, SensorProtocols(), "sensor", "sensor", sensor.name);
}

}  // namespace plumb
