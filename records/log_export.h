#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>

#include "robot/description.h"

namespace plumb {

// What is in an LCM log, for other tools. Thread-safe but for the files.

/// What became of a log's messages.
struct ExportCounts {
  int64_t messages = 0;  ///< that were written
  double seconds = 0;    ///< from the first to the last
  size_t channels = 0;
  int64_t scenes = 0;    ///< of the robot, that were added
  bool cut_off = false;  ///< the log, in the middle of its last message
  /// Channels of which messages were left out, and why, with how many: of no type of ours, do not
  /// decode, more columns than a table can have, more channels than anybody has. A hundred at most.
  std::map<std::string, int64_t> left_out;
};

/// As MCAP: every message in JSON with its JSON Schema, by the time of its reception; and, if the
/// robot is known, PLUMB_SCENE, a foxglove.SceneUpdate for ROBOT_STATE, 30 a second at most, each
/// with PLUMB_FRAME, the frame that goes with it.
/// @param robot null = unknown. @param notes that go into the file's metadata.
/// @throws std::runtime_error naming the file: the log cannot be read or is damaged, the output
/// cannot be written; what there is already then stays.
ExportCounts ExportMcap(const std::string& log, const std::filesystem::path& file,
                        const RobotDescription* robot,
                        const std::map<std::string, std::string>& notes);

/// As tables (MessageTable), FOLDER/CHANNEL.csv each; what is no letter, digit, - or _ in a
/// channel's name is %XX there.
/// @throws std::runtime_error as ExportMcap.
ExportCounts ExportCsv(const std::string& log, const std::filesystem::path& folder);

}  // namespace plumb
