#include "robot/place_in_file.h"

#include "common/config.h"

namespace plumb {

std::string PlaceInFile(const RobotDescription& robot, const std::string& table,
                        const std::string& name, const std::string& key) {
  if (robot.file.empty()) return "";
  try {
    Config root = Config::Load(robot.file);
    for (Config& entry : root.Tables(table)) {
      if (entry.String("name") == name) return entry.Position(key);
    }
  } catch (const ConfigError&) {
    return robot.file + ": ";  // it has changed since, which is not what is complained of
  }
  return "";
}

}  // namespace plumb
