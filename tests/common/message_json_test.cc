#include "common/message_json.h"

#include <catch2/catch.hpp>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "common/message_bytes.h"
#include "common/message_scalars.h"
#include "common/message_schema.h"
#include "common/message_walk.h"
#include "common/seal.h"
#include "plumb/driver_status_t.hpp"
#include "plumb/imu_t.hpp"
#include "plumb/joint_state_t.hpp"
#include "plumb/parameter_distribution_t.hpp"
#include "plumb/robot_state_t.hpp"
#include "tests/common/sealed_message.h"

namespace plumb {
namespace {

using json = nlohmann::ordered_json;  // fields in the message's order

std::string Environment(const char* name) {
  const char* const value = std::getenv(name);
  return value ? value : ".";
}

/// Messages of all types, as Python has made and read them.
struct Sample {
  const MessageType* type;
  Bytes bytes;
  json expected;
};

std::vector<Sample> ReadSamples() {
  const std::string source = Environment("PLUMBLINE_SOURCE");
  const std::string call = "timeout 60 /usr/bin/python3 " + source + "/tests/common/messages.py " +
                           source + "/lcmtypes " + Environment("PLUMBLINE_BUILD") +
                           "/lcmtypes/python";
  std::string output;
  FILE* const pipe = popen(call.c_str(), "r");
  REQUIRE(pipe);
  char part[4096];
  for (size_t size; (size = fread(part, 1, sizeof part, pipe)) > 0;) output.append(part, size);
  REQUIRE(pclose(pipe) == 0);
  std::vector<Sample> samples;
  std::istringstream lines(output);
  for (std::string name, hex, text; lines >> name >> hex && std::getline(lines, text);) {
    Sample& sample = samples.emplace_back();
    sample.type = FindMessageType(name);
    REQUIRE(sample.type);
    for (size_t i = 0; i < hex.size(); i += 2)
      sample.bytes.push_back(static_cast<uint8_t>(std::stoi(hex.substr(i, 2), nullptr, 16)));
    sample.expected = json::parse(text);
  }
  return samples;
}

const std::vector<Sample>& Samples() {
  static const std::vector<Sample> samples = ReadSamples();
  return samples;
}

std::string Json(const MessageType& type, std::span<const uint8_t> bytes) {
  std::string text;
  return AppendJson(type, bytes, text) ? text : "does not decode";
}

TEST_CASE("a message of any type becomes the JSON that lcm-gen's Python makes of it") {
  std::set<std::string> seen;
  for (const Sample& sample : Samples()) {
    INFO(sample.type->name << ' ' << sample.expected);
    CHECK(json::parse(Json(*sample.type, sample.bytes)) == sample.expected);
    CHECK(TypeOf(sample.bytes) == sample.type);
    seen.insert(sample.type->name);
  }
  for (const MessageType& type : MessageTypes()) CHECK(seen.contains(type.name));
}

void ListLeaves(const std::string& path, const json& value, std::vector<std::string>& paths) {
  if (value.is_object()) {
    for (const auto& [name, part] : value.items())
      ListLeaves(path.empty() ? name : path + "." + name, part, paths);
  } else if (value.is_array()) {
    for (size_t i = 0; i < value.size(); ++i)
      ListLeaves(path + "[" + std::to_string(i) + "]", value[i], paths);
  } else {
    paths.push_back(path);
  }
}

TEST_CASE("a message's scalars one by one are the JSON's leaves, with their paths") {
  for (const Sample& sample : Samples()) {
    std::vector<std::string> found, expected;
    CHECK(ForEachScalar(*sample.type, sample.bytes,
                        [&](const std::string& path, const Scalar&) { found.push_back(path); }));
    ListLeaves("", sample.expected, expected);
    CHECK(found == expected);
  }
}

TEST_CASE("a message's scalars have their values") {
  robot_state_t state{};
  state.sequence = 7;
  state.num_positions = state.num_velocities = 1;
  state.q = {0.25};
  state.v = state.q_sd = state.v_sd = state.effort = {0};
  state.num_contacts = 2;
  state.contact = {1, -1};
  state.valid = true;
  std::map<std::string, Scalar> values;
  CHECK(ForEachScalar(*FindMessageType("robot_state_t"), Encode(state),
                      [&](const std::string& path, const Scalar& value) { values[path] = value; }));
  CHECK(values["sequence"] == Scalar(int64_t{7}));
  CHECK(values["q[0]"] == Scalar(0.25));
  CHECK(values["contact[1]"] == Scalar(int64_t{-1}));
  CHECK(values["valid"] == Scalar(true));
}

TEST_CASE(
    "what is cut, lengthened or of another type does not decode, whatever it says of lengths") {
  for (const Sample& sample : Samples()) {
    for (size_t size = 0; size < sample.bytes.size(); ++size)
      CHECK_FALSE(Decodes(*sample.type, std::span(sample.bytes).first(size)));
    Bytes longer = sample.bytes;
    longer.push_back(0);
    CHECK_FALSE(Decodes(*sample.type, longer));
    for (const MessageType& other : MessageTypes())
      CHECK(Decodes(other, sample.bytes) == (&other == sample.type));
  }
  Bytes huge = Encode(robot_state_t{});
  // the number of positions, behind fingerprint, utime and sequence
  for (const std::vector<uint8_t>& count :
       {Bytes{0x7f, 0xff, 0xff, 0xff}, Bytes{0xff, 0xff, 0xff, 0xff}, Bytes{0, 0, 0, 100}}) {
    std::ranges::copy(count, huge.begin() + 24);
    CHECK(Json(*FindMessageType("robot_state_t"), huge) == "does not decode");
  }
}

TEST_CASE("what does not decode leaves the text as it was") {
  std::string text = "before";
  Bytes cut = Encoded();
  cut.pop_back();
  CHECK_FALSE(AppendJson(*FindMessageType("joint_command_t"), cut, text));
  CHECK(text == "before");
}

TEST_CASE("a seal behind a message is not a part of it") {
  Identity sender("plumb-controller", {}, Clock(), Identity::Reach::kMachine, 0);
  const MessageType& type = *FindMessageType("joint_command_t");
  CHECK(Json(type, Say(sender)) == Json(type, Encoded()));
}

TEST_CASE("a message without a seal whose last bytes look like one is whole") {
  std::vector<uint8_t> bytes = Encode(imu_t{});
  const std::string magic = "PLUMSEAL";  // in the midst of its numbers
  std::copy(magic.begin(), magic.end(), bytes.end() - static_cast<ptrdiff_t>(kSealSize));
  imu_t own;
  REQUIRE(own.decode(bytes.data(), 0, static_cast<int>(bytes.size())) ==
          static_cast<int>(bytes.size()));
  std::string text;
  CHECK(AppendJson(*FindMessageType("imu_t"), bytes, text));
}

TEST_CASE("a single has its own shortest digits, and text from outside cannot break out") {
  parameter_distribution_t distribution{};
  distribution.residual_margin = 0.1f;
  CHECK(Json(*FindMessageType("parameter_distribution_t"), Encode(distribution))
            .find("\"residual_margin\":0.1,") != std::string::npos);
  driver_status_t status{};
  status.reason = "\"</script>\x1b[31m\x80\\";
  const json read = json::parse(Json(*FindMessageType("driver_status_t"), Encode(status)));
  CHECK(read["reason"] == "\"</script>\xef\xbf\xbd[31m\xef\xbf\xbd\\");
}

/// Whether a value is what a JSON Schema of ours says.
bool Fits(const json& value, const json& schema) {
  const std::string& type = schema["type"].get_ref<const std::string&>();
  if (type == "object") {
    if (value.size() != schema["properties"].size()) return false;
    return std::ranges::all_of(value.items(), [&](const auto& field) {
      return schema["properties"].contains(field.key()) &&
             Fits(field.value(), schema["properties"][field.key()]);
    });
  }
  if (type == "array")
    return std::ranges::all_of(value, [&](const json& one) { return Fits(one, schema["items"]); });
  if (type == "number") return value.is_number() || value.is_null();
  if (type == "integer") return value.is_number_integer();
  if (type == "boolean") return value.is_boolean();
  return type == "string" && value.is_string();
}

TEST_CASE("every message is what its schema says") {
  for (const Sample& sample : Samples()) {
    const json schema = json::parse(JsonSchema(*sample.type));
    CHECK(schema["title"] == "plumb." + sample.type->name);
    CHECK(Fits(json::parse(Json(*sample.type, sample.bytes)), schema));
  }
}

TEST_CASE("a schema says by what an array is counted, and how a matrix lies") {
  const json schema = json::parse(JsonSchema(*FindMessageType("driver_status_t")));
  CHECK(schema["properties"]["phase_duration"]["description"] ==
        "[num_phases][num_bins], row by row");
  CHECK(schema["properties"]["joint_name"]["description"] == "[num_joints]");
  CHECK(json::parse(JsonSchema(*FindMessageType("imu_t")))["properties"]["rate"]["description"] ==
        "[3]");
}

}  // namespace
}  // namespace plumb
