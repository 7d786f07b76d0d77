// libFuzzer: whatever clients and LCM say to the dashboard's gateway, in whatever order, what it
// says is JSON, what waits for a client has its bound, and nothing but a service asks the driver
// for anything.

#include <nlohmann/json.hpp>

#include "dashboard/access.h"
#include "dashboard/gateway.h"
#include "dashboard/page.h"
#include "tests/fuzz/files/input_file.h"

namespace plumb {
namespace {

bool IsJson(const std::string& payload, size_t from) {
  return nlohmann::json::accept(payload.begin() + static_cast<std::ptrdiff_t>(from), payload.end());
}

void TakeAll(Viewer& viewer) {
  while (const auto item = viewer.outbox.Pop()) {
    const bool answers = item->binary && !item->is_message();
    Require(item->tells_time() || IsJson(*item->payload, answers ? 17 : 0));
  }
}

}  // namespace
}  // namespace plumb

// One after the other, each behind its kind and its length.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace plumb;
  int64_t requests = 0, calls = 0;
  Gateway gateway(FuzzRobot(), {}, [&](const driver_request_t&) { ++requests; });
  Gateway::Moment moment{0, 1'700'000'000'000'000, 1'700'000'000'000'000};
  Viewer viewer("", [] {}), other("not you", [] {});
  gateway.Join(viewer);
  gateway.Join(other);
  const std::span<const MessageType> types = MessageTypes();
  for (std::span<const uint8_t> rest(data, size); rest.size() >= 3;) {
    const uint8_t kind = rest[0] % 8, which = rest[1];
    const auto part = rest.subspan(3).first(std::min<size_t>(rest[2], rest.size() - 3));
    const std::string_view text = Text(part.data(), part.size());
    rest = rest.subspan(3 + part.size());
    moment.now += 1000 * which;
    Viewer& who = which % 2 ? viewer : other;
    if (kind == 0) {
      gateway.OnText(who, text);
    } else if (kind == 1) {
      ++calls;
      gateway.OnBinary(who, part, moment);
    } else if (kind == 2) {
      gateway.Tick(moment);
    } else if (kind == 3) {
      const Access access{{"robot.lab"}, {}, "0123"};
      access.OriginAllowed(text, text);
      if (access.HostAllowed(text)) Require(!text.empty());
      Require(!access.TokenGiven(text) || text.find("0123") != std::string_view::npos);
      Require(!PageFolder(PendulumFile("..")).Find("/" + std::string(text)) || text.empty());
    } else if (kind == 4) {
      TakeAll(who);
    } else {
      static constexpr const char* kChannels[] = {"ROBOT_STATE", "DRIVER_STATUS", "PLACE_ROBOT",
                                                  "CONTROLLER_STATUS", "PARAMETER_DISTRIBUTION"};
      const MessageType& type = types[which % types.size()];
      std::vector<uint8_t> bytes(8);
      for (size_t i = 0; i < 8; ++i)
        bytes[i] = static_cast<uint8_t>(type.fingerprint >> (56 - 8 * i));
      bytes.insert(bytes.end(), part.begin(), part.end());
      std::string channel = kChannels[which % std::size(kChannels)];
      if (kind == 6) channel = std::string(text.substr(0, 20));
      gateway.OnMessage(channel, bytes, kind != 7, moment.now, moment);
    }
  }
  moment.now += 10'000'000;
  gateway.Tick(moment);
  Require(calls > 0 || requests == 0);
  gateway.Leave(other);
  TakeAll(viewer);
  TakeAll(other);
  gateway.Leave(viewer);
  return 0;
}
