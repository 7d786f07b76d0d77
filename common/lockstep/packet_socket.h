#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

namespace plumb {

/// Packets on a Unix socket, in chunks: four bytes of length, then the packet. Not thread-safe.
class PacketSocket {
 public:
  /// [bytes] a longer packet is not one of ours
  static constexpr size_t kLongest = size_t{64} << 20;

  PacketSocket() = default;
  explicit PacketSocket(int fd) : fd_(fd) {}
  PacketSocket(PacketSocket&& other) noexcept;
  PacketSocket& operator=(PacketSocket&& other) noexcept;
  ~PacketSocket();

  /// Sockets at a path in the file system, however long: relative to its folder.
  /// @throws std::runtime_error naming the path and the cause.
  static PacketSocket Listen(const std::string& path);
  static PacketSocket Connect(const std::string& path);
  /// One who has connected; !open() if nobody has.
  PacketSocket Accept() const;

  bool open() const { return fd_ >= 0; }
  int fd() const { return fd_; }
  void Close();

  /// Sends all of it, waiting for a receiver that does not read. @param waiting called every tenth
  /// of a second meanwhile; false gives up. @return false if the other end is gone, or it was given
  /// up.
  bool Send(std::span<const uint8_t> packet, const std::function<bool()>& waiting = {});
  enum class When { kNow, kSoon };
  /// Reads what there is, or, kSoon, waits for it, but for a tenth of a second at most. @return
  /// false if the other end is gone or sends no packets.
  bool Read(When when);
  /// The next complete packet of what has been read; empty if there is none. Valid until the next
  /// call.
  std::span<const uint8_t> Next();

 private:
  /// Of the next packet [bytes]; 0 if that much has not come yet.
  size_t Length() const;

  int fd_ = -1;
  std::vector<uint8_t> in_, out_;
  size_t begin_ = 0, end_ = 0;  // of what has been read into in_ and not been taken
};

}  // namespace plumb
