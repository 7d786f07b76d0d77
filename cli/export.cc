#include "cli/export.h"

#include <fmt/format.h>

#include <filesystem>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <system_error>

#include "cli/outputs.h"
#include "records/log_export.h"
#include "records/record_folder.h"
#include "robot/description.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

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
    const ExportCounts counts = ExportMcap(flags.log, flags.mcap, robot ? &*robot : nullptr,
                                           RecordFolder::Notes(flags.log));
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
