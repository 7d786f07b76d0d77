#include "calibrator/motion/recorded_robot.h"

#include <fmt/format.h>

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <system_error>

namespace plumb {
namespace {

std::optional<RobotDescription> ReadRecordedRobot(const std::string& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) return {};
  try {
    return LoadRobot(file);
  } catch (const std::exception&) {
    return {};
  }
}

// Empty if there is none.
std::string OtherJoint(const RobotDescription& recorded, const RobotDescription& robot) {
  if (recorded.num_joints() != robot.num_joints())
    return fmt::format("it has {} joints, not {}", recorded.num_joints(), robot.num_joints());
  for (size_t i = 0; i < robot.joints.size(); ++i) {
    const std::string &its = recorded.joints[i].name, &ours = robot.joints[i].name;
    if (its != ours) return fmt::format("its joint {} is {}, not {}", i + 1, its, ours);
  }
  return {};
}

}  // namespace

std::vector<std::string> CheckRecordedRobot(const std::string& log, const RobotDescription& robot) {
  const std::string file = log + ".d/robot.toml";
  const std::optional<RobotDescription> recorded = ReadRecordedRobot(file);
  if (!recorded) return {};
  const std::string other = OtherJoint(*recorded, robot);
  if (other.empty()) return {};
  if (recorded->name == robot.name)
    return {fmt::format("its robot is not as {} has it: {}, says {}", robot.file, other, file)};
  throw std::runtime_error(
      fmt::format("{}: is a log of {}, not of {}: {}, says {}; if it is the same robot under "
                  "another name, move that file away",
                  log, recorded->name, robot.name, other, file));
}

}  // namespace plumb
