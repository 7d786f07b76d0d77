#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "common/name_lock.h"

namespace plumb {

/// What somebody needs who comes upon a log later, in the folder LOG.d beside it:
///
///   record.json                  what was recorded, when, by which version and command
///   robot.toml, robot.urdf       the robot, with all that its file extends: a robot's folder
///   meshes/                      its collision meshes, which robot.urdf names
///   parameter_distribution.json  the newest PARAMETER_DISTRIBUTION in the log
///   lcmtypes/                    what the messages mean, for lcm-gen
///
/// Not thread-safe.
class RecordFolder {
 public:
  struct About {
    std::string program;  ///< with its version
    std::string command;  ///< that was given
    std::string note;     ///< a person's
    std::string clock;    ///< "virtual", "real"
    std::string robot;    ///< folder or TOML file; empty = not known
  };

  /// The folder of a log.
  static std::filesystem::path Of(const std::string& log) { return log + ".d"; }
  /// What record.json beside a log says, and the log's name ("log"); of what it does not say, or
  /// cannot be read, nothing.
  static std::map<std::string, std::string> Notes(const std::string& log);
  /// The files that are written for a log, whatever there is to be said.
  static std::vector<std::string> Files(const std::string& log);

  /// Makes the folder, and writes all that is known at the beginning; what an earlier recording of
  /// that name has left is replaced or removed.
  /// @throws std::runtime_error naming a file that cannot be written, or the folder if somebody has
  /// something else in it, or writes it now; ConfigError of a robot.
  RecordFolder(const std::string& log, const About& about);

  /// A message that goes into the log. @throws std::runtime_error naming a file that cannot be
  /// written.
  void Hear(const std::string& channel, std::span<const uint8_t> message);

 private:
  std::filesystem::path folder_;
  NameLock lock_;
  std::vector<uint8_t> distribution_;  // the newest, as it came
};

}  // namespace plumb
