#include "calibrator/results/json_lines.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

namespace plumb {
namespace {

using json = nlohmann::ordered_json;

std::string Dump(const json& j) { return j.dump(-1, ' ', false, json::error_handler_t::replace); }

std::string Print(const json& j, const std::string& indent) {
  const bool rows = j.is_array() && !j.empty() && j.front().is_structured();
  if (!rows && (!j.is_object() || j.empty())) return Dump(j);
  std::string text;
  const std::string deeper = indent + " ";
  for (const auto& [key, value] : j.items()) {
    text += fmt::format("{}\n{}{}", text.empty() ? "" : ",", deeper,
                        rows ? Dump(value) : Dump(key) + ": " + Print(value, deeper));
  }
  return fmt::format("{}{}\n{}{}", rows ? "[" : "{", text, indent, rows ? "]" : "}");
}

}  // namespace

std::string JsonLines(const json& json) { return Print(json, "") + "\n"; }

}  // namespace plumb
