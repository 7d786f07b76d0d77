#pragma once

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

namespace plumb {

/// LCM's datagrams byte by byte, as its protocol description has them, independently of our reader.

inline void PutWord(std::vector<uint8_t>& bytes, uint32_t word, int size = 4) {
  for (int i = size; i-- > 0;) bytes.push_back(static_cast<uint8_t>(word >> (8 * i)));
}

inline void PutText(std::vector<uint8_t>& bytes, const std::string& text) {
  bytes.insert(bytes.end(), text.begin(), text.end());
}

inline std::vector<uint8_t> Whole(const std::string& channel, const std::string& data) {
  std::vector<uint8_t> bytes;
  PutWord(bytes, 0x4c433032), PutWord(bytes, 1);
  PutText(bytes, channel + '\0' + data);
  return bytes;
}

/// A fragment that says what you like. @param channel of the first fragment; empty: none.
inline std::vector<uint8_t> FragmentWith(const std::string& channel, size_t size, uint32_t offset,
                                         uint32_t sequence, uint32_t number, uint32_t count,
                                         size_t payload) {
  std::vector<uint8_t> bytes;
  PutWord(bytes, 0x4c433033), PutWord(bytes, sequence);
  PutWord(bytes, static_cast<uint32_t>(size)), PutWord(bytes, offset);
  PutWord(bytes, number, 2), PutWord(bytes, count, 2);
  if (!channel.empty()) PutText(bytes, channel + '\0');
  bytes.resize(bytes.size() + payload, 0x55);
  return bytes;
}

/// Fragment `number` of `count` of a message.
inline std::vector<uint8_t> Fragment(const std::string& channel, const std::string& data,
                                     uint32_t sequence, uint32_t number, uint32_t count) {
  const size_t share = (data.size() + count - 1) / count;
  const size_t offset = std::min(number * share, data.size());
  std::vector<uint8_t> bytes =
      FragmentWith(number == 0 ? channel : "", data.size(), static_cast<uint32_t>(offset), sequence,
                   number, count, 0);
  PutText(bytes, data.substr(offset, share));
  return bytes;
}

/// A socket that sends anything anywhere. Multicast stays on this machine.
class RawSender {
 public:
  RawSender(const std::string& address, int port) {
    const int ttl = 0;
    setsockopt(fd_, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl);
    to_.sin_family = AF_INET;
    to_.sin_port = htons(static_cast<uint16_t>(port));
    inet_pton(AF_INET, address.c_str(), &to_.sin_addr);
  }
  ~RawSender() { close(fd_); }
  RawSender(const RawSender&) = delete;
  RawSender& operator=(const RawSender&) = delete;

  void Send(std::span<const uint8_t> bytes) const {
    sendto(fd_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to_), sizeof to_);
  }

 private:
  const int fd_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in to_{};
};

}  // namespace plumb
