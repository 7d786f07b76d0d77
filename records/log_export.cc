#include "records/log_export.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <span>
#include <system_error>
#include <utility>

#include "common/atomic_file.h"
#include "common/lcm_log_reader.h"
#include "common/message_bytes.h"
#include "common/message_json.h"
#include "common/message_schema.h"
#include "common/message_type.h"
#include "common/outside_text.h"
#include "common/program_version.h"
#include "common/seal.h"
#include "plumb/robot_state_t.hpp"
#include "records/mcap_writer.h"
#include "records/message_table.h"
#include "sim/view/scene_update.h"

namespace plumb {
namespace {

// A process may have some 1000 files open.
constexpr size_t kMostChannels = 500, kMostReasons = 100;
constexpr size_t kMostColumnsInAll = 1'000'000;   // which take some 200 MB
constexpr int64_t kScenePeriod = 1'000'000 / 30;  // [us]

/// A channel may have messages of several types; each is a channel of its own in what is written.
using Key = std::pair<std::string, const MessageType*>;

struct Event {
  const std::string& channel;
  int64_t utime;
  const MessageType& type;
  std::span<const uint8_t> message;  // without its seal
};

void LeaveOut(ExportCounts& counts, const std::string& channel, const char* why) {
  const std::string reason = Printable(channel) + ": " + why;
  if (counts.left_out.size() < kMostReasons || counts.left_out.contains(reason))
    ++counts.left_out[reason];
}

/// Hands the messages of our types to `on_event`, and counts the others.
/// @param most events. @return how many there were.
int64_t ReadEvents(const std::string& file, ExportCounts& counts, int64_t most,
                   const std::function<void(const Event&)>& on_event) {
  LcmLogReader log(file);
  LcmLogEvent event;
  std::optional<int64_t> begin;
  int64_t events = 0;
  for (; events < most && log.Read(event); ++events) {
    if (!begin) begin = event.utime;
    counts.seconds = std::max(
        counts.seconds, (static_cast<double>(event.utime) - static_cast<double>(*begin)) * 1e-6);
    const std::span<const uint8_t> message = Unsealed(event.data);
    if (const MessageType* const type = TypeOf(message))
      on_event({event.channel, event.utime, *type, message});
    else
      LeaveOut(counts, event.channel, "of no type of ours");
  }
  counts.cut_off = log.cut_off();
  return events;
}

/// MCAP's times [ns]. Hostile ones become its first or its last moment.
uint64_t Nanoseconds(int64_t utime) {
  constexpr int64_t kMost = INT64_MAX / 1000;
  return static_cast<uint64_t>(std::clamp<int64_t>(utime, 0, kMost)) * 1000;
}

/// The robot's states as scenes, not more often than anybody sees.
class Scenes {
 public:
  Scenes(const RobotDescription& robot, McapWriter& writer)
      : robot_(robot),
        update_(robot),
        writer_(writer),
        channel_(writer.AddChannel(
            "PLUMB_SCENE",
            writer.AddSchema("foxglove.SceneUpdate", "jsonschema", SceneUpdate::Schema()), "json")),
        frames_(writer.AddChannel(
            "PLUMB_FRAME",
            writer.AddSchema("foxglove.FrameTransform", "jsonschema", SceneUpdate::FrameSchema()),
            "json")) {}

  /// @return whether a scene was written.
  bool Hear(const Event& event) {
    if (event.channel != "ROBOT_STATE" || event.type.name != "robot_state_t") return false;
    const bool back = event.utime < last_;
    if (any_ && !back && event.utime - last_ < kScenePeriod) return false;
    robot_state_t state;
    if (!Decode(event.message, state)) return false;
    const Eigen::VectorXd q = Eigen::Map<const Eigen::VectorXd>(
        state.q.data(), static_cast<Eigen::Index>(state.q.size()));
    if (q.size() != robot_.num_positions() || !q.allFinite()) return false;
    const uint64_t now = Nanoseconds(event.utime);
    writer_.Write(frames_, now, now, update_.FrameJson(event.utime, q));
    writer_.Write(channel_, now, now, update_.Json(event.utime, q));
    last_ = event.utime;
    return any_ = true;
  }

 private:
  const RobotDescription& robot_;
  const SceneUpdate update_;
  McapWriter& writer_;
  const uint16_t channel_, frames_;
  bool any_ = false;
  int64_t last_ = 0;  // [us]
};

/// The message's own time, where it has one.
uint64_t Published(const Event& event, const std::string& json) {
  constexpr std::string_view kBegin = "{\"utime\":";
  if (!json.starts_with(kBegin)) return Nanoseconds(event.utime);
  return Nanoseconds(std::strtoll(json.c_str() + kBegin.size(), nullptr, 10));
}

std::string FileName(const std::string& channel) {
  std::string name;
  for (const char c : channel) {
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '-' || c == '_';
    name += plain ? std::string(1, c) : fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return name;
}

}  // namespace

ExportCounts ExportMcap(const std::string& log, const std::filesystem::path& file,
                        const RobotDescription* robot,
                        const std::map<std::string, std::string>& notes) {
  ExportCounts counts;
  McapWriter writer(file, "plumb " + ProgramVersion());
  if (!notes.empty()) writer.AddMetadata("record", notes);
  std::optional<Scenes> scenes;
  if (robot) scenes.emplace(*robot, writer);
  std::map<const MessageType*, uint16_t> schemas;
  std::map<Key, uint16_t> channels;
  std::string json;
  ReadEvents(log, counts, INT64_MAX, [&](const Event& event) {
    json.clear();
    if (!AppendJson(event.type, event.message, json))
      return LeaveOut(counts, event.channel, "do not decode");
    auto channel = channels.find({event.channel, &event.type});
    if (channel == channels.end()) {
      if (channels.size() >= kMostChannels)
        return LeaveOut(counts, "others", "more channels than a file can have");
      auto schema = schemas.find(&event.type);
      if (schema == schemas.end()) {
        const uint16_t id =
            writer.AddSchema(QualifiedName(event.type), "jsonschema", JsonSchema(event.type));
        schema = schemas.emplace(&event.type, id).first;
      }
      const uint16_t id = writer.AddChannel(Printable(event.channel), schema->second, "json");
      channel = channels.emplace(Key{event.channel, &event.type}, id).first;
    }
    writer.Write(channel->second, Nanoseconds(event.utime), Published(event, json), json);
    ++counts.messages;
    if (scenes && scenes->Hear(event)) ++counts.scenes;
  });
  counts.channels = channels.size();
  writer.Finish();
  return counts;
}

ExportCounts ExportCsv(const std::string& log, const std::filesystem::path& folder) {
  ExportCounts counts;
  std::map<Key, MessageTable> tables;
  size_t columns = 0;  // of all
  const int64_t events = ReadEvents(log, counts, INT64_MAX, [&](const Event& event) {
    auto table = tables.find({event.channel, &event.type});
    if (table == tables.end()) {
      if (tables.size() >= kMostChannels)
        return LeaveOut(counts, "others", "more channels than a folder can have");
      table = tables.try_emplace({event.channel, &event.type}, event.type).first;
    }
    columns -= table->second.columns();
    if (!table->second.Measure(event.message)) LeaveOut(counts, event.channel, "do not decode");
    columns += table->second.columns();
    if (columns > kMostColumnsInAll)
      throw std::runtime_error(
          fmt::format("{}: its tables would have more than {} columns", log, kMostColumnsInAll));
  });
  MakeFolder(folder);
  std::string before;
  for (auto& [key, table] : tables) {
    const auto& [channel, type] = key;
    // Of several types each has a file.
    const std::string name = FileName(channel) + (channel == before ? "." + type->name : "");
    before = channel;
    if (table.too_wide()) {
      counts.left_out[fmt::format("{}: more than {} columns", Printable(channel),
                                  MessageTable::kMostColumns)] += table.rows();
    } else if (table.rows() > 0) {
      const std::filesystem::path file = folder / (name + ".csv");
      if (std::error_code none; std::filesystem::equivalent(file, log, none))
        throw std::runtime_error(file.string() + ": is read, too: give another folder to write");
      table.Open(file);
      ++counts.channels;
      counts.messages += table.rows();
    }
  }
  ExportCounts again;
  // No more than were measured: the log may be growing.
  ReadEvents(log, again, events, [&](const Event& event) {
    const auto table = tables.find({event.channel, &event.type});
    if (table != tables.end() && table->second.open())
      table->second.Write(event.utime, event.message);
  });
  for (auto& [key, table] : tables) {
    if (table.open()) table.Finish();
  }
  return counts;
}

}  // namespace plumb
