#include "robot/json_text.h"

#include <fmt/format.h>

#include <cctype>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

namespace plumb {
namespace {

constexpr int kDeepest = 100;
constexpr size_t kLongestNumber = 100;  // a double has 17 digits

void RequireModest(std::string_view text) {
  int depth = 0;
  size_t number = 0;
  for (size_t at = 0; at < text.size(); ++at) {
    const char c = text[at];
    const bool of_a_number = std::isdigit(static_cast<unsigned char>(c)) || c == '.';
    number = of_a_number ? number + 1 : 0;
    if (number > kLongestNumber)
      throw std::runtime_error(
          fmt::format("byte {}: a number of more than {} digits", at, kLongestNumber));
    depth += (c == '[' || c == '{') - (c == ']' || c == '}');
    if (depth > kDeepest)
      throw std::runtime_error(fmt::format("byte {}: nests deeper than {}", at, kDeepest));
    if (c != '"') continue;
    for (++at; at < text.size() && text[at] != '"'; ++at) at += text[at] == '\\';
  }
}

// Without the "[json.exception.parse_error.101] " in front, which tells a reader nothing.
std::string InPlainWords(std::string_view complaint) {
  const size_t end = complaint.starts_with('[') ? complaint.find("] ") : std::string_view::npos;
  return std::string(end == std::string_view::npos ? complaint : complaint.substr(end + 2));
}

}  // namespace

nlohmann::json ParseJson(std::string_view text) {
  RequireModest(text);
  try {
    return nlohmann::json::parse(text);
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error(InPlainWords(error.what()));
  }
}

}  // namespace plumb
