#include "trainer/policy_record.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "common/process.h"

namespace plumb {
namespace {

using nlohmann::json;

constexpr double kSamePeriod = 1e-6;     // relative
constexpr size_t kLongestExcerpt = 300;  // [characters] of a property, in an error

std::vector<std::string> ActionUnits(const RobotDescription& robot) {
  std::vector<std::string> units;
  for (const int i : robot.driven()) {
    const bool slides =
        robot.joints[static_cast<size_t>(i)].type == JointDescription::Type::kPrismatic;
    units.push_back(slides ? "N" : "Nm");
  }
  return units;
}

// Names come from files of any encoding; JSON is UTF-8.
std::string Text(const json& value) {
  return value.dump(-1, ' ', false, json::error_handler_t::replace);
}

std::string Excerpt(const json& value) {
  const std::string text = Text(value);
  return text.size() <= kLongestExcerpt ? text : text.substr(0, kLongestExcerpt) + "...";
}

/// Reads properties, naming the one that is at fault.
class RecordReader {
 public:
  explicit RecordReader(const std::map<std::string, std::string>& properties)
      : properties_(properties) {}

  void operator()(const char* name, std::string& text) const { text = Find(name); }
  template <class Number>
  void operator()(const char* name, Number& number) const {
    const std::string& text = Find(name);
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc() || end != text.data() + text.size())
      Fail(name, "is no number that fits");
    if (!std::isfinite(static_cast<double>(number))) Fail(name, "is not finite");
  }
  void operator()(const char* name, std::optional<double>& number) const {
    if (properties_.contains(name)) (*this)(name, number.emplace());
  }
  void operator()(const char* name, std::vector<std::string>& list) const {
    const json value = Parse(name);
    if (!value.is_array()) Fail(name, "is no list");
    for (const json& item : value) {
      if (!item.is_string()) Fail(name, "is no list of texts");
      list.push_back(item.get<std::string>());
    }
  }
  void operator()(const char* name, std::map<std::string, double>& figures) const {
    const json value = Parse(name);
    if (!value.is_object()) Fail(name, "is no JSON object");
    for (const auto& [key, figure] : value.items()) {
      if (!figure.is_number()) Fail(name, "has a figure that is no number");
      figures[key] = figure.get<double>();
    }
  }
  [[noreturn]] static void Fail(const std::string& name, const std::string& what) {
    throw std::invalid_argument("property '" + name + "' " + what);
  }

 private:
  const std::string& Find(const char* name) const {
    const auto found = properties_.find(name);
    if (found == properties_.end()) Fail(name, "is missing");
    return found->second;
  }
  json Parse(const char* name) const {
    json value = json::parse(Find(name), nullptr, /*allow_exceptions=*/false);
    if (value.is_discarded()) Fail(name, "is no JSON");
    return value;
  }

  const std::map<std::string, std::string>& properties_;
};

class RecordWriter {
 public:
  void operator()(const char* name, const std::string& text) { properties[name] = text; }
  void operator()(const char* name, const std::vector<std::string>& list) {
    properties[name] = Text(list);
  }
  void operator()(const char* name, const std::map<std::string, double>& figures) {
    properties[name] = Text(figures);
  }
  void operator()(const char* name, const std::optional<double>& number) {
    if (number) (*this)(name, *number);
  }
  template <class Number>
  void operator()(const char* name, const Number& number) {
    properties[name] = fmt::format("{}", number);
  }
  std::map<std::string, std::string> properties;
};

/// The one list of what is in the file, for writing and reading.
template <class Archive, class Record>
void TransferRecord(Archive& archive, Record& record) {
  archive("robot", record.robot);
  archive("task", record.task);
  archive("observations", record.observation_names);
  archive("actions", record.action_names);
  archive("units", record.action_units);
  archive("period", record.period);
  archive("posterior", record.posterior);
  archive("version", record.version);
  archive("seed", record.seed);
  archive("steps", record.steps);
  archive("training_return", record.training_return);
  archive("evaluation", record.evaluation);
}

}  // namespace

PolicyRecord MakePolicyRecord(const RobotDescription& robot, const Task& task) {
  PolicyRecord record;
  record.robot = robot.name;
  record.task = robot.task.name;
  record.observation_names = task.observation_names();
  record.action_names = task.action_names();
  record.action_units = ActionUnits(robot);
  record.period = robot.task.period;
  record.version = VersionLine("plumb");
  return record;
}

void RequireSameTask(const PolicyRecord& record, const RobotDescription& robot, const Task& task) {
  const auto require = [](const char* what, const auto& of_policy, const auto& expected) {
    if (Text(of_policy) == Text(expected)) return;
    throw std::invalid_argument(fmt::format("the policy is for another {}: {}, not {}", what,
                                            Excerpt(of_policy), Excerpt(expected)));
  };
  require("robot", record.robot, robot.name);
  require("task", record.task, robot.task.name);
  require("list of observations", record.observation_names, task.observation_names());
  require("list of driven joints", record.action_names, task.action_names());
  require("list of units of effort", record.action_units, ActionUnits(robot));
  if (std::abs(record.period - robot.task.period) > kSamePeriod * robot.task.period) {
    require("control period [s]", record.period, robot.task.period);
  }
}

std::map<std::string, std::string> ToProperties(const PolicyRecord& record) {
  RecordWriter writer;
  TransferRecord(writer, record);
  return writer.properties;
}

PolicyRecord FromProperties(const std::map<std::string, std::string>& properties) {
  PolicyRecord record;
  const RecordReader reader(properties);
  TransferRecord(reader, record);
  if (record.period <= 0) RecordReader::Fail("period", "is not positive");
  if (record.steps < 0) RecordReader::Fail("steps", "is negative");
  return record;
}

}  // namespace plumb
