#include "robot/buses.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <string_view>

namespace plumb {

std::string BusDescription::Label() const { return name.empty() ? "the bus" : "bus " + name; }

std::vector<std::string> UrlsOf(const std::vector<BusDescription>& buses) {
  std::vector<std::string> urls;
  urls.reserve(buses.size());
  for (const BusDescription& bus : buses)
    urls.push_back(bus.name.empty() ? bus.url : bus.name + "=" + bus.url);
  return urls;
}

std::string InOneLine(const std::vector<BusDescription>& buses) {
  return fmt::format("{}", fmt::join(UrlsOf(buses), " "));
}

std::string InnermostBus(std::string url) {
  constexpr std::string_view kFaulty = "faulty:";
  while (url.starts_with(kFaulty)) {
    const size_t colon = url.find(':', kFaulty.size());
    url.erase(0, colon == std::string::npos ? kFaulty.size() : colon + 1);
  }
  return url;
}

}  // namespace plumb
