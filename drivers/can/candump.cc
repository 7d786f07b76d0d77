#include "drivers/can/candump.h"

#include <algorithm>
#include <charconv>

namespace plumb {
namespace {

constexpr std::string_view kBlanks = " \t\r\n";

/// The next word, which is taken off the text; empty at its end.
std::string_view Word(std::string_view& text) {
  text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
  const std::string_view word = text.substr(0, text.find_first_of(kBlanks));
  text.remove_prefix(word.size());
  return word;
}

/// A whole number of digits only.
bool ParseDigits(std::string_view digits, int64_t& number) {
  const char* end = digits.data() + digits.size();
  const auto parsed = std::from_chars(digits.data(), end, number);
  return !digits.empty() && digits[0] != '-' && parsed.ec == std::errc{} && parsed.ptr == end;
}

/// "(seconds.decimals)" in nanoseconds.
bool ParseTimestamp(std::string_view text, int64_t& time) {
  if (!text.starts_with('(') || !text.ends_with(')') || text.size() < 2) return false;
  text = text.substr(1, text.size() - 2);
  const size_t point = text.find('.');
  int64_t seconds, decimals;
  // Ten digits of seconds last until the year 2286, and in 64 bits of nanoseconds until
  // 9,223,372,036 s.
  if (point == std::string_view::npos || !ParseDigits(text.substr(0, point), seconds) ||
      seconds > 9'000'000'000) {
    return false;
  }
  const std::string_view rest = text.substr(point + 1);
  if (rest.size() > 9 || !ParseDigits(rest, decimals)) return false;
  for (size_t i = rest.size(); i < 9; ++i) decimals *= 10;
  time = seconds * 1'000'000'000 + decimals;
  return true;
}

}  // namespace

std::optional<LoggedFrame> ParseCandump(std::string_view line) noexcept {
  LoggedFrame logged;
  if (!ParseTimestamp(Word(line), logged.time_ns)) return {};
  logged.interface = Word(line);
  const auto frame = FrameFromText(Word(line));
  if (!frame) return {};
  const std::string_view direction = Word(line);
  if ((!direction.empty() && direction != "R" && direction != "T") || !Word(line).empty())
    return {};
  logged.frame = *frame;
  logged.frame.receive_ns = logged.time_ns;
  return logged;
}

}  // namespace plumb
