#include "drivers/can/faults.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>
#include <string_view>

namespace plumb {
namespace {

constexpr int64_t kLongest = 60'000'000;  // [us]

template <class Number>
bool ParseNumber(std::string_view text, Number& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc{} && end == text.data() + text.size();
}

bool ParseProbability(std::string_view text, double& probability) {
  return ParseNumber(text, probability) && probability >= 0 && probability <= 1;
}

/// "500us", "2ms", "1.5s".
bool ParseDuration(std::string_view text, int64_t& time) {
  double unit = 1e6;
  if (text.ends_with("us")) {
    unit = 1;
  } else if (text.ends_with("ms")) {
    unit = 1e3;
  } else if (!text.ends_with("s")) {
    return false;
  }
  text.remove_suffix(unit == 1e6 ? 1 : 2);
  double number;
  if (!ParseNumber(text, number) || !(number >= 0 && number * unit <= kLongest)) return false;
  time = std::llround(number * unit);
  return true;
}

enum class Outcome { kSet, kUnknown, kBadValue };

Outcome SetSide(Faults::Side& side, std::string_view name, std::string_view value) {
  double Faults::Side::*probability = name == "loss"        ? &Faults::Side::loss
                                      : name == "duplicate" ? &Faults::Side::duplicate
                                      : name == "reorder"   ? &Faults::Side::reorder
                                      : name == "corrupt"   ? &Faults::Side::corrupt
                                                            : nullptr;
  int64_t Faults::Side::*time = name == "delay"    ? &Faults::Side::delay
                                : name == "jitter" ? &Faults::Side::jitter
                                                   : nullptr;
  if (probability == nullptr && time == nullptr) return Outcome::kUnknown;
  const bool good =
      probability ? ParseProbability(value, side.*probability) : ParseDuration(value, side.*time);
  return good ? Outcome::kSet : Outcome::kBadValue;
}

Outcome Set(Faults& faults, std::string_view name, std::string_view value) {
  if (name == "seed") return ParseNumber(value, faults.seed) ? Outcome::kSet : Outcome::kBadValue;
  const bool receive = name.starts_with("rx."), send = name.starts_with("tx.");
  const std::string_view bare = receive || send ? name.substr(3) : name;
  double* probability = bare == "full" && !receive  ? &faults.full
                        : bare == "errors" && !send ? &faults.errors
                        : bare == "busoff" && !send ? &faults.busoff
                                                    : nullptr;
  if (probability)
    return ParseProbability(value, *probability) ? Outcome::kSet : Outcome::kBadValue;
  const Outcome outcome = SetSide(receive ? faults.receive : faults.send, bare, value);
  if (outcome == Outcome::kSet && !receive && !send) return SetSide(faults.receive, bare, value);
  return outcome;
}

}  // namespace

Faults ParseFaults(const std::string& text) {
  Faults faults;
  std::string_view rest = text;
  while (!rest.empty()) {
    const std::string_view fault = rest.substr(0, rest.find(','));
    rest.remove_prefix(std::min(fault.size() + 1, rest.size()));
    const size_t equals = fault.find('=');
    if (equals == std::string_view::npos) {
      throw std::invalid_argument(fmt::format("'{}' is not NAME=VALUE", fault));
    }
    switch (Set(faults, fault.substr(0, equals), fault.substr(equals + 1))) {
      case Outcome::kSet:
        break;
      case Outcome::kUnknown:
        throw std::invalid_argument(fmt::format(
            "'{}': there is loss, duplicate, reorder, corrupt, delay, jitter (of rx. and tx., or "
            "both), full (tx.), errors, busoff (rx.) and seed",
            fault));
      case Outcome::kBadValue:
        throw std::invalid_argument(fmt::format(
            "'{}': probabilities are 0 to 1, times such as 500us or 2ms up to a minute, the seed "
            "a whole number",
            fault));
    }
  }
  return faults;
}

}  // namespace plumb
