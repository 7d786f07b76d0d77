#include "drivers/can/transport.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "drivers/can/faulty.h"
#include "drivers/can/lockstep_transport.h"
#include "drivers/can/loop.h"
#include "drivers/can/replay.h"
#include "drivers/can/socketcan.h"
#include "drivers/can/udp.h"

namespace plumb {
namespace {

bool Matches(const Filter& filter, const Frame& frame) noexcept {
  return frame.extended == filter.extended &&
         (frame.id & filter.mask) == (filter.id & filter.mask) && (filter.remote || !frame.remote);
}

}  // namespace

bool Transport::Passes(const Frame& frame) const noexcept {
  if (filters_.empty() || frame.error) return true;
  return std::ranges::any_of(filters_,
                             [&](const Filter& filter) { return Matches(filter, frame); });
}

bool Transport::IsOurs(const Frame& frame) const noexcept {
  if (frame.error) return false;
  return std::ranges::any_of(
      filters_, [&](const Filter& filter) { return filter.own && Matches(filter, frame); });
}

std::unique_ptr<Transport> OpenTransport(const std::string& url, std::vector<Filter> filters,
                                         LockstepBus run) {
  const auto colon = url.find(':');
  const std::string scheme = url.substr(0, colon);
  const std::string rest = colon == std::string::npos ? "" : url.substr(colon + 1);
  const bool lockstep = run.participant != nullptr;
  std::unique_ptr<Transport> bus;
  if (scheme == "faulty") return OpenFaulty(rest, std::move(filters), run);
  if (scheme == "replay") return OpenReplay(rest, std::move(filters));
  if (scheme == "loop" && lockstep) return OpenLockstep(url, nullptr, std::move(filters), run);
  if (scheme == "loop") return OpenLoop(rest, std::move(filters));
  if (scheme == "socketcan") bus = OpenSocketCan(rest, filters);
  if (scheme == "udp") bus = OpenUdp(rest, filters, lockstep);
  if (bus)
    return lockstep ? OpenLockstep(url, std::move(bus), std::move(filters), run) : std::move(bus);
  throw std::runtime_error(
      fmt::format("bus '{}' is not socketcan:INTERFACE, udp:GROUP:PORT, loop:NAME, replay:FILE or "
                  "faulty:FAULTS:BUS",
                  url));
}

}  // namespace plumb
