#include "records/record_folder.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <system_error>

#include "common/atomic_file.h"
#include "common/config.h"
#include "common/message_json.h"
#include "common/message_type.h"
#include "common/seal.h"
#include "records/message_definitions.h"
#include "robot/description.h"
#include "robot/json_text.h"
#include "robot/urdf/mesh.h"
#include "robot/urdf/urdf.h"
#include "robot/urdf/xml_edits.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr char kRecord[] = "record.json", kToml[] = "robot.toml", kUrdf[] = "robot.urdf",
               kDistribution[] = "parameter_distribution.json", kTypes[] = "lcmtypes",
               kMeshes[] = "meshes";

std::string RecordJson(const std::string& log, const RecordFolder::About& about,
                       const std::string& robot_name) {
  std::string json = "{";
  const auto add = [&](const char* key, const std::string& value) {
    json += fmt::format("{}\n \"{}\": ", json.size() > 1 ? "," : "", key);
    if (value.empty())
      json += "null";
    else
      AppendJsonText(value, json);
  };
  add("log", fs::path(log).filename().string());
  add("begun", fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr))));
  add("program", about.program);
  add("command", about.command);
  add("note", about.note);
  add("clock", about.clock);
  add("robot", robot_name);
  return json + "\n}\n";
}

struct Robot {
  std::string name, toml, urdf;
  std::map<std::string, std::string> meshes;  // by their names in the record
};

// The URDF, in which those of the robot's collision meshes that are read have names in the record.
void ReadUrdf(const std::string& file, const std::vector<std::string>& meshes, Robot* robot) {
  XmlEdits edits(ReadFile(file));
  ForEachCollisionMesh(edits.root(), [&](const TiXmlElement& mesh) {
    const char* named = mesh.Attribute("filename");
    const std::string path = named ? FindMesh(named, file) : "";
    const auto read = std::ranges::find(meshes, path);
    if (read == meshes.end()) return;
    const std::string name =
        fmt::format("{}/{}{}", kMeshes, read - meshes.begin(), fs::path(path).extension().string());
    if (robot->meshes.emplace(name, "").second) robot->meshes[name] = ReadFile(path);
    edits.SetAttribute(mesh, "filename", name);
  });
  robot->urdf = edits.Print();
}

Robot ReadRobot(const std::string& folder_or_file) {
  const RobotDescription description = LoadRobot(folder_or_file);
  Config root = Config::Load(description.file);
  Config header = root.Table("robot");
  const std::string urdf = FindUrdf(header);
  Robot robot{description.name, MergedToml(description.file, "robot", "urdf", kUrdf), {}, {}};
  ReadUrdf(urdf, description.meshes, &robot);
  return robot;
}

}  // namespace

std::map<std::string, std::string> RecordFolder::Notes(const std::string& log) {
  std::map<std::string, std::string> notes{{"log", fs::path(log).filename().string()}};
  const fs::path file = Of(log) / kRecord;
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

std::vector<std::string> RecordFolder::Files(const std::string& log) {
  std::vector<std::string> files;
  for (const char* name : {kRecord, kToml, kUrdf, kDistribution})
    files.push_back((Of(log) / name).string());
  return files;
}

RecordFolder::RecordFolder(const std::string& log, const About& about)
    : folder_(Of(log)), lock_("record " + NameOfFile(folder_), log + ": is being written already") {
  // Read before anything is removed: it may be the folder of an earlier recording.
  std::optional<Robot> robot;
  if (!about.robot.empty()) robot = ReadRobot(about.robot);
  std::error_code error;
  if (fs::exists(folder_, error) && !fs::exists(folder_ / kRecord, error) &&
      !fs::is_empty(folder_, error)) {
    throw std::runtime_error(
        fmt::format("{}: is there and no log's: its files are not written over", folder_.string()));
  }
  MakeFolder(folder_);
  // First, and never missing: it says whose folder this is, to whoever comes after a kill.
  WriteAtomically(folder_ / kRecord, RecordJson(log, about, robot ? robot->name : ""));
  for (const char* earlier : {kToml, kUrdf, kDistribution}) fs::remove(folder_ / earlier, error);
  MakeFolder(folder_ / kTypes);
  for (const MessageDefinition& definition : MessageDefinitions())
    WriteAtomically(folder_ / kTypes / definition.file, definition.text);
  fs::remove_all(folder_ / kMeshes, error);
  if (!robot) return;
  if (!robot->meshes.empty()) MakeFolder(folder_ / kMeshes);
  for (const auto& [name, bytes] : robot->meshes) WriteAtomically(folder_ / name, bytes);
  WriteAtomically(folder_ / kUrdf, robot->urdf);
  WriteAtomically(folder_ / kToml, robot->toml);
}

void RecordFolder::Hear(const std::string& channel, std::span<const uint8_t> message) {
  if (channel != "PARAMETER_DISTRIBUTION") return;
  const std::span<const uint8_t> bytes = Unsealed(message);
  if (std::ranges::equal(bytes, distribution_)) return;  // it is repeated
  std::string json;
  const MessageType* const type = FindMessageType("parameter_distribution_t");
  if (!type || !AppendJson(*type, bytes, json)) return;
  WriteAtomically(folder_ / kDistribution, json + "\n");
  distribution_.assign(bytes.begin(), bytes.end());
}

}  // namespace plumb
