#include "common/log_limit.h"

#include <algorithm>
#include <utility>

namespace plumb {
namespace {

constexpr size_t kMaxName = 60;

}  // namespace

std::optional<int64_t> LogLimit::Admit(std::string_view line, int64_t now) {
  std::string_view name = line.substr(0, std::min(line.find_first_of("0123456789:'\""), kMaxName));
  if (!kinds_.contains(name) && kinds_.size() >= kMaxKinds) name = "";
  Kind& kind = kinds_.try_emplace(std::string(name), Kind{now}).first->second;
  // Every line takes a period of what is left until the burst is used up.
  const int64_t full_again = std::max(kind.full_again, now) + kPeriod;
  if (full_again - now > kBurst * kPeriod) {
    ++kind.held_back;
    return std::nullopt;
  }
  kind.full_again = full_again;
  return std::exchange(kind.held_back, 0);
}

}  // namespace plumb
