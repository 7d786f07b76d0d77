#include "records/log_export.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "common/config.h"
#include "common/lcm_log_writer.h"
#include "common/message_bytes.h"
#include "common/seal.h"
#include "plumb/driver_status_t.hpp"
#include "plumb/parameter_distribution_t.hpp"
#include "plumb/policy_t.hpp"
#include "plumb/robot_state_t.hpp"
#include "tests/records/mcap_file.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

constexpr int64_t kBegin = 1'700'000'000'000'000;

template <class Message>
std::vector<uint8_t> Sealed(const Message& message) {
  std::vector<uint8_t> bytes = Encode(message);
  bytes.resize(bytes.size() + kSealSize);
  WriteSeal({1, 2, 3, 4, {}}, nullptr, "", "", "", bytes);
  return bytes;
}

robot_state_t State(int i) {
  robot_state_t state{};
  state.utime = kBegin + 10'000 * i - 1500;
  state.sequence = i;
  state.num_positions = state.num_velocities = 1;
  state.q = {0.1 * i};
  state.v = {std::nextafter(1.0 / 3, i)};
  state.q_sd = {NAN};
  state.v_sd = {-std::numeric_limits<double>::infinity()};
  state.effort = {1e-300};
  state.valid = true;
  return state;
}

parameter_distribution_t Distribution(int parameters) {
  parameter_distribution_t message{};
  message.num_parameters = parameters;
  for (int i = 0; i < parameters; ++i)
    message.name.push_back("\"mass\", of\nlink " + std::to_string(i));
  message.coordinate.assign(static_cast<size_t>(parameters), 1);
  message.num_residuals = parameters;
  message.residual.resize(static_cast<size_t>(parameters));
  for (auto& residual : message.residual) {
    residual.num_inputs = parameters;
    residual.mean.assign(static_cast<size_t>(parameters), 0.1f);
    residual.scale = residual.low = residual.high = residual.mean;
  }
  return message;
}

/// Five seconds of a pendulum's states, two distributions, and what has no place in a log.
struct Recorded {
  Recorded() {
    LcmLogWriter writer(log);
    const auto write = [&](int64_t utime, const std::string& channel, const auto& message) {
      writer.Write(utime, channel, message);
    };
    for (int i = 0; i < 500; ++i) write(kBegin + 10'000 * i, "ROBOT_STATE", Sealed(State(i)));
    write(kBegin + 1, "PARAMETER_DISTRIBUTION", Sealed(Distribution(2)));
    write(kBegin + 2, "PARAMETER_DISTRIBUTION", Sealed(Distribution(3)));
    write(kBegin + 3, "ROBOT_STATE", Sealed(driver_status_t{}));
    write(kBegin + 4, "../of/others", std::vector<uint8_t>(20));
    std::vector<uint8_t> short_one = Sealed(State(1));
    short_one.resize(40);
    write(kBegin + 5, "ROBOT_STATE", short_one);
    writer.Flush();
  }
  RobotDescription robot =
      LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/pendulum");
  TemporaryFolder folder;
  const std::string log = folder / "a.lcmlog";
};

TEST_CASE_METHOD(Recorded,
                 "an MCAP file has all messages of the log, with their values and times") {
  const ExportCounts counts = ExportMcap(log, folder / "a.mcap", nullptr, {{"note", "x"}});
  CHECK(counts.messages == 503);
  CHECK(counts.channels == 3);
  CHECK(counts.seconds == Approx(4.99));
  CHECK(counts.scenes == 0);
  CHECK(counts.left_out == std::map<std::string, int64_t>{{"../of/others: of no type of ours", 1},
                                                          {"ROBOT_STATE: do not decode", 1}});
  const McapFile file(ReadFile(folder / "a.mcap"));
  CHECK(file.messages.size() == 503);
  int states = 0;
  for (const auto& message : file.Of("ROBOT_STATE")) {
    const auto json = nlohmann::json::parse(message.data);
    if (!json.contains("q")) continue;  // the driver's, who has lost its way
    const robot_state_t state = State(states);
    CHECK(message.logged == static_cast<uint64_t>(kBegin + 10'000 * states) * 1000);
    CHECK(message.published == static_cast<uint64_t>(state.utime) * 1000);
    CHECK(json.at("q")[0].get<double>() == state.q[0]);
    CHECK(json.at("v")[0].get<double>() == state.v[0]);
    CHECK(json.at("q_sd")[0].is_null());
    CHECK(json.at("effort")[0].get<double>() == 1e-300);
    ++states;
  }
  CHECK(states == 500);
  for (const auto& [id, schema] : file.schemas) {
    CHECK(schema.encoding == "jsonschema");
    CHECK(nlohmann::json::parse(schema.data).at("type") == "object");
  }
  CHECK(file.metadata.at("record").at("note") == "x");
}

TEST_CASE_METHOD(Recorded, "the robot is drawn where it was, thirty times a second at most") {
  const ExportCounts counts = ExportMcap(log, folder / "a.mcap", &robot, {});
  CHECK(counts.scenes == 125);  // every fourth of them
  const McapFile file(ReadFile(folder / "a.mcap"));
  const auto scenes = file.Of("PLUMB_SCENE");
  REQUIRE(scenes.size() == 125);
  const auto scene = nlohmann::json::parse(scenes[1].data);
  bool drawn = false;
  for (const auto& entity : scene.at("entities")) drawn = drawn || entity.at("id") == "robot";
  CHECK(drawn);
  CHECK(scenes[1].logged == static_cast<uint64_t>(kBegin + 40'000) * 1000);
  const auto frames = file.Of("PLUMB_FRAME");
  REQUIRE(frames.size() == scenes.size());
  CHECK(frames[1].logged == scenes[1].logged);
  CHECK(nlohmann::json::parse(frames[1].data).at("translation").at("z") == 0);
  int known = 0;
  for (const auto& [id, schema] : file.schemas)
    known += schema.name == "foxglove.SceneUpdate" || schema.name == "foxglove.FrameTransform";
  CHECK(known == 2);
}

/// A table's cells, quotes resolved.
std::vector<std::vector<std::string>> Cells(const std::string& file) {
  std::vector<std::vector<std::string>> rows{{""}};
  bool quoted = false;
  const std::string text = ReadFile(file);
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (c == '"' && quoted && i + 1 < text.size() && text[i + 1] == '"') {
      rows.back().back() += '"', ++i;
    } else if (c == '"') {
      quoted = !quoted;
    } else if (c == ',' && !quoted) {
      rows.back().emplace_back();
    } else if (c == '\n' && !quoted) {
      rows.push_back({""});
    } else {
      rows.back().back() += c;
    }
  }
  rows.pop_back();
  return rows;
}

TEST_CASE_METHOD(Recorded,
                 "a table has a column for each number, which reads back to the same bits") {
  const ExportCounts counts = ExportCsv(log, folder / "tables");
  CHECK(counts.messages == 503);
  CHECK(counts.channels == 3);
  CHECK(counts.left_out.size() == 2);
  const auto rows = Cells(folder / "tables/ROBOT_STATE.csv");
  const auto other = Cells(folder / "tables/ROBOT_STATE.robot_state_t.csv");
  // Of the two types on one channel the first in the alphabet has the plain name.
  REQUIRE(rows.size() == 2);
  REQUIRE(other.size() == 501);
  CHECK(other[0] == std::vector<std::string>{"received", "utime", "sequence", "num_positions",
                                             "q[0]", "num_velocities", "v[0]", "q_sd[0]", "v_sd[0]",
                                             "effort[0]", "num_contacts", "model_based", "valid",
                                             "restarted"});
  for (int i = 0; i < 500; ++i) {
    const auto& row = other[static_cast<size_t>(i) + 1];
    const robot_state_t state = State(i);
    REQUIRE(row.size() == other[0].size());
    CHECK(row[0] == std::to_string(kBegin + 10'000 * i));
    CHECK(row[1] == std::to_string(state.utime));
    CHECK(std::stod(row[4]) == state.q[0]);
    CHECK(std::stod(row[6]) == state.v[0]);
    CHECK(row[7] == "nan");
    CHECK(row[8] == "-inf");
    CHECK(std::strtod(row[9].c_str(), nullptr) == 1e-300);
    CHECK(row[12] == "1");
  }
}

TEST_CASE_METHOD(Recorded, "arrays that grow, structs in arrays and texts have their columns") {
  ExportCsv(log, folder / "tables");
  const auto rows = Cells(folder / "tables/PARAMETER_DISTRIBUTION.csv");
  REQUIRE(rows.size() == 3);
  const auto cell = [&](size_t row, const std::string& column) {
    const auto found = std::ranges::find(rows[0], column);
    INFO(column);
    REQUIRE(found != rows[0].end());
    return rows[row].at(static_cast<size_t>(found - rows[0].begin()));
  };
  CHECK(cell(1, "name[1]") == "\"mass\", of link 1");
  CHECK(cell(1, "name[2]").empty());
  CHECK(cell(2, "name[2]") == "\"mass\", of link 2");
  CHECK(cell(1, "residual[1].mean[1]") == "0.1");
  CHECK(cell(1, "residual[1].mean[2]").empty());
  CHECK(cell(2, "residual[2].mean[2]") == "0.1");
  CHECK(std::ranges::count(rows[0], "residual[2].mean[2]") == 1);
}

TEST_CASE("a message of too many columns has no table, and is named") {
  const TemporaryFolder folder;
  policy_t policy{};
  policy.num_weights = 60'000;
  policy.weight.resize(60'000);
  {
    LcmLogWriter writer(folder / "a.lcmlog");
    writer.Write(1, "POLICY", Sealed(policy));
    writer.Flush();
  }
  const ExportCounts counts = ExportCsv(folder / "a.lcmlog", folder / "tables");
  CHECK(counts.channels == 0);
  CHECK(counts.left_out == std::map<std::string, int64_t>{{"POLICY: more than 50000 columns", 1}});
}

TEST_CASE("a channel's name makes no line of its own among what is told") {
  const TemporaryFolder folder;
  const std::string log = folder / "a.lcmlog";
  {
    LcmLogWriter writer(log);
    const std::vector<uint8_t> nothing(8, 0xEE);
    writer.Write(1, "A\nwrote /etc/passwd", nothing);
    writer.Flush();
  }
  const ExportCounts counts = ExportCsv(log, folder / "tables");
  REQUIRE(counts.left_out.size() == 1);
  CHECK(counts.left_out.begin()->first == "A wrote /etc/passwd: of no type of ours");
}

TEST_CASE("a damaged log leaves no file, and a channel's name is no path") {
  const TemporaryFolder folder;
  const std::string log = folder / "a.lcmlog";
  {
    LcmLogWriter writer(log);
    writer.Write(1, "../../x", Sealed(State(1)));
    writer.Write(2, "..", Sealed(State(1)));
    writer.Flush();
  }
  CHECK(ExportCsv(log, folder / "tables").channels == 2);
  CHECK(std::filesystem::exists(folder / "tables/%2E%2E%2F%2E%2E%2Fx.csv"));
  CHECK(std::filesystem::exists(folder / "tables/%2E%2E.csv"));
  { std::ofstream(log, std::ios::app) << std::string(100, 'x'); }
  CHECK_THROWS_WITH(ExportMcap(log, folder / "a.mcap", nullptr, {}),
                    Catch::StartsWith(log + ": damaged at byte "));
  CHECK_FALSE(std::filesystem::exists(folder / "a.mcap"));
}

}  // namespace
}  // namespace plumb
