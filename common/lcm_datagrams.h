#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace plumb {

/// Size of the largest message that is put together from datagrams [bytes].
inline constexpr size_t kMaxLcmMessage = size_t{4} << 20;

/// LCM's messages from its datagrams ("LC02", a message; "LC03", a fragment of one; as
/// lcm/lcm_udpm.c of lcm-proj/lcm 1.3.1 sends them). Whatever the datagrams hold, nothing is read
/// or written out of bounds, and messages that are not complete yet take 16 MB at most: those of
/// the senders that have been silent longest are given up for others. Fragments are to come in
/// order, as they are sent; a message of which one is missing is lost. Not thread-safe.
class LcmDatagrams {
 public:
  struct Message {
    std::string_view channel;       ///< at most 63 characters
    std::span<const uint8_t> data;  ///< at most kMaxLcmMessage
  };
  /// Whether anybody listens to a channel: other messages are not put together.
  using Wanted = std::function<bool(std::string_view channel)>;

  explicit LcmDatagrams(Wanted wanted) : wanted_(std::move(wanted)) {}

  /// @param sender tells senders apart. @return the wanted message that is complete with this
  /// datagram, valid as long as that is and until the next call; nothing for any other datagram.
  std::optional<Message> Take(uint64_t sender, std::span<const uint8_t> datagram);

  /// Bytes that messages which are not complete yet have taken.
  size_t pending() const { return pending_; }

 private:
  struct Incomplete {
    uint32_t sequence, size;
    uint16_t count, next;  // fragments of the message, and which of them is to come
    std::string channel;
    std::vector<uint8_t> data;
    uint64_t heard;  // number of the last datagram
  };

  std::optional<Message> TakeFragment(uint64_t sender, std::span<const uint8_t> datagram);
  void Forget(std::map<uint64_t, Incomplete>::iterator incomplete);
  void MakeRoom();

  Wanted wanted_;
  std::map<uint64_t, Incomplete> incomplete_;  // by sender
  size_t pending_ = 0;
  uint64_t datagrams_ = 0;
  Incomplete complete_{};  // the last message that came in fragments
};

}  // namespace plumb
