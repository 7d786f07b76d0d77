#include "drivers/can/transport.h"

#include <fmt/format.h>

#include <stdexcept>

#include "drivers/can/loop.h"
#include "drivers/can/socketcan.h"
#include "drivers/can/udp.h"

namespace plumb {

bool Transport::Passes(const Frame& frame) const noexcept {
  if (filters_.empty() || frame.error) return true;
  for (const Filter& filter : filters_) {
    if (!frame.extended && (frame.id & filter.mask) == (filter.id & filter.mask) &&
        (filter.remote || !frame.remote)) {
      return true;
    }
  }
  return false;
}

std::unique_ptr<Transport> OpenTransport(const std::string& url, std::vector<Filter> filters) {
  const auto colon = url.find(':');
  const std::string scheme = url.substr(0, colon);
  const std::string rest = colon == std::string::npos ? "" : url.substr(colon + 1);
  if (scheme == "socketcan") return OpenSocketCan(rest, std::move(filters));
  if (scheme == "udp") return OpenUdp(rest, std::move(filters));
  if (scheme == "loop") return OpenLoop(rest, std::move(filters));
  throw std::runtime_error(
      fmt::format("bus '{}' is not socketcan:INTERFACE, udp:GROUP:PORT or loop:NAME", url));
}

}  // namespace plumb
