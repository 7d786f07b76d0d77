#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace plumb {

// The words of Foxglove's WebSocket protocol, version 1, both ways: JSON texts, and binary frames
// whose numbers are little-endian. https://github.com/foxglove/ws-protocol. Thread-safe.

inline constexpr char kFoxgloveProtocol[] = "foxglove.websocket.v1";
inline constexpr size_t kMaxClientMessage = 64 << 10;  ///< [bytes] that a client may say at once

/// What a server has to say, on and on.
struct FoxgloveTopic {
  uint32_t id;
  std::string name;         ///< "ROBOT_STATE"
  std::string schema_name;  ///< "plumb.robot_state_t"
  std::string schema;       ///< a JSON Schema
};

std::string ServerInfoText(std::string_view name, std::string_view session);
std::string AdvertiseText(std::span<const FoxgloveTopic> topics);
/// Services are numbered in this order, from 1 on. All of them take {} and give
/// {"ok":bool,"text":string}.
std::string AdvertiseServicesText(std::span<const std::string_view> services);
/// @param level 0 to inform, 1 to warn, 2 an error.
std::string StatusText(int level, std::string_view message);
std::string ServiceFailureText(uint32_t service, uint32_t call, std::string_view message);

/// What stands before a message's JSON in its binary frame. @param utime [us]
using MessageHead = std::array<uint8_t, 13>;
MessageHead MessageHeadOf(uint32_t subscription, int64_t utime);
/// Whole binary frames.
std::string TimeFrame(int64_t utime);  ///< what time it is in the run [us]
std::string ServiceResponse(uint32_t service, uint32_t call, std::string_view json);

/// What a client has said. Empty if it was something that asks for nothing.
struct ClientMessage {
  struct Subscription {
    uint32_t id, topic;
  };
  struct Call {
    uint32_t service, id;
  };
  std::vector<Subscription> subscribe;
  std::vector<uint32_t> unsubscribe;
  std::optional<Call> call;
};

/// @throws std::runtime_error, one line that says what is wrong with it, for the client.
ClientMessage ParseClientText(std::string_view text);
ClientMessage ParseClientBinary(std::span<const uint8_t> frame);

}  // namespace plumb
