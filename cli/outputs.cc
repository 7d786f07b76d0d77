#include "cli/outputs.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <stdexcept>
#include <system_error>

#include "common/atomic_file.h"
#include "common/config.h"
#include "common/name_lock.h"
#include "records/record_folder.h"

namespace plumb {

void RequireNotRead(const std::vector<std::string>& outputs,
                    const std::vector<std::string>& inputs) {
  std::error_code not_there;  // a file that does not exist yet is the input of nothing
  for (const std::string& output : outputs) {
    for (const std::string& input : inputs) {
      if (!output.empty() && !input.empty() &&
          std::filesystem::equivalent(output, input, not_there))
        throw std::invalid_argument(output + ": is read, too: give another file to write");
    }
  }
}

void RequireApart(const std::vector<std::string>& outputs) {
  std::set<std::string> taken;
  for (const std::string& output : outputs) {
    if (output.empty()) continue;
    if (!taken.insert(NameOfFile(output)).second)
      throw std::invalid_argument(output + ": would be written twice: outputs need a file each");
  }
}

void RequireOutputs(const std::vector<std::string>& outputs,
                    const std::vector<std::string>& inputs) {
  RequireNotRead(outputs, inputs);
  RequireApart(outputs);
  for (const std::string& output : outputs) {
    if (!output.empty()) RequireWritable(output);
  }
}

std::vector<std::string> FilesOf(const RobotDescription& robot) {
  std::vector<std::string> files = robot.meshes;
  Config root = Config::Load(robot.file, &files);
  Config header = root.Table("robot");
  files.push_back(FindUrdf(header));
  return files;
}

void RequireSameKind(const std::string& file, const std::string& begins, const std::string& kind) {
  std::error_code not_there;
  if (file.empty() || !std::filesystem::is_regular_file(file, not_there)) return;
  std::string found(begins.size(), '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(found.data(), static_cast<std::streamsize>(found.size()));
  found.resize(static_cast<size_t>(stream.gcount()));
  if (!begins.starts_with(found))
    throw std::invalid_argument(file + ": is there and not " + kind + ": it is not written over");
}

void RequireLcmLog(const std::string& file) {
  RequireSameKind(file, "\xed\xa1\xda\x01", "an LCM log");
}

void RequireOverwritable(const std::string& log, const std::string& robot) {
  std::error_code not_there;
  if (log.empty() || !std::filesystem::is_regular_file(log, not_there) ||
      std::filesystem::file_size(log, not_there) == 0)
    return;
  const std::map<std::string, std::string> wanted{{"clock", "virtual"}, {"robot", robot}};
  const std::map<std::string, std::string> notes = RecordFolder::Notes(log);
  const bool again = !robot.empty() && std::ranges::includes(notes, wanted);
  if (!again)
    throw std::invalid_argument(
        log + ": holds a recording that cannot be made again: give another name, or --overwrite");
}

}  // namespace plumb
