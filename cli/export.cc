#include "cli/export.h"

#include <fmt/format.h>

#include <filesystem>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <system_error>

#include "cli/outputs.h"
#include "common/config.h"
#include "records/log_export.h"
#include "records/record_folder.h"
#include "robot/description.h"
#include "robot/json_text.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// Of the folder beside the log: its record, as far as it can be read.
std::map<std::string, std::string> NotesOf(const std::string& log) {
  std::map<std::string, std::string> notes{{"log", fs::path(log).filename().string()}};
  const fs::path file = RecordFolder::Of(log) / "record.json";
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return notes;
  nlohmann::json record;
  try {
    record = ParseJson(ReadFile(file.string()));
  } catch (const std::exception&) {
    return notes;
  }
  if (!record.is_object()) return notes;
  for (const auto& [key, value] : record.items()) {
    if (value.is_string()) notes[key] = value.get<std::string>();
  }
  return notes;
}

std::optional<RobotDescription> RobotOf(const ExportFlags& flags) {
  if (!flags.robot.empty()) return LoadRobot(flags.robot);
  const fs::path folder = RecordFolder::Of(flags.log);
  std::error_code error;
  if (!fs::exists(folder / "robot.toml", error)) return {};
  return LoadRobot(folder.string());
}

void Report(const ExportCounts& counts, const std::string& log, const std::string& output) {
  std::cout << fmt::format("{}: {} messages of {} channels, {:.1f} s{}\n", log, counts.messages,
                           counts.channels, counts.seconds,
                           counts.cut_off ? "; the last one is cut off" : "");
  for (const auto& [reason, messages] : counts.left_out)
    std::cout << fmt::format("! left out: {} of {}\n", messages, reason);
  std::cout << "wrote " << output << std::endl;
}

}  // namespace

int Export(const ExportFlags& flags) {
  if (flags.mcap.empty() && flags.csv.empty())
    throw std::invalid_argument("nothing to write: give --mcap FILE, --csv FOLDER, or both");
  if (!flags.mcap.empty()) {
    RequireOutputs({flags.mcap}, {flags.log});
    RequireSameKind(flags.mcap, "\x89MCAP", "an MCAP file");
    const std::optional<RobotDescription> robot = RobotOf(flags);
    const ExportCounts counts =
        ExportMcap(flags.log, flags.mcap, robot ? &*robot : nullptr, NotesOf(flags.log));
    if (!robot)
      std::cout << "no robot.toml beside the log, and no --robot: the robot is not drawn\n";
    Report(counts, flags.log,
           flags.mcap + (counts.scenes > 0
                             ? fmt::format(", with {} pictures of the robot", counts.scenes)
                             : std::string()));
  }
  if (!flags.csv.empty()) Report(ExportCsv(flags.log, flags.csv), flags.log, flags.csv);
  return 0;
}

}  // namespace plumb
