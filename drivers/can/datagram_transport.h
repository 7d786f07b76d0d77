#pragma once

#include <netinet/in.h>
#include <sys/socket.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "drivers/can/receive_control.h"
#include "drivers/can/transport.h"

namespace plumb {

/// The common part of SocketCAN and UDP: a frame is a datagram, and many of them travel in one
/// system call. Counts, stamps and sorts out; what is left to the kinds of bus is what a datagram
/// looks like. Not thread-safe, as Transport.
class DatagramTransport : public Transport {
 public:
  int Send(std::span<const Frame> frames) noexcept final;
  int Receive(std::span<Frame> frames) noexcept final;

 protected:
  static constexpr size_t kMaxDatagram = 512;  ///< bytes

  struct Datagram {
    std::span<const uint8_t> bytes;
    sockaddr_in source;  ///< only of UDP
    int flags;           ///< of recvmsg: MSG_CONFIRM, MSG_TRUNC
  };

  explicit DatagramTransport(std::vector<Filter> filters);

  virtual int sender() const noexcept = 0;    ///< socket
  virtual int receiver() const noexcept = 0;  ///< socket
  /// @return the datagram's length.
  virtual size_t Encode(const Frame& frame, std::span<uint8_t> datagram) noexcept = 0;
  /// @return false if it is no frame.
  virtual bool Decode(std::span<const uint8_t> datagram, Frame& frame) noexcept = 0;
  /// True if this transport has sent it.
  virtual bool IsEcho(const Datagram& datagram) const noexcept = 0;
  /// A call has failed with this errno. Of receiving also EAGAIN: nothing waits.
  virtual void OnSendError(int error) noexcept = 0;
  virtual void OnReceiveError(int error) noexcept = 0;
  /// False while nothing can go out: Send refuses.
  virtual bool may_send() const noexcept { return true; }

  /// The receiver is a new socket, whose count of losses begins at zero.
  void NoteNewReceiver() noexcept { lost_before_ = stats_.lost; }

 private:
  /// The places of many datagrams, wired to each other.
  template <size_t kCount>
  struct Batch {
    Batch() {
      for (size_t i = 0; i < kCount; ++i) {
        parts[i] = {buffers[i].data(), buffers[i].size()};
        messages[i].msg_hdr.msg_iov = &parts[i];
        messages[i].msg_hdr.msg_iovlen = 1;
      }
    }
    std::array<std::array<uint8_t, kMaxDatagram>, kCount> buffers;
    std::array<iovec, kCount> parts;
    std::array<mmsghdr, kCount> messages{};
  };
  static constexpr size_t kReceived = 16;
  static constexpr size_t kSent = FrameBatch::kCapacity;

  bool Take(size_t index, Frame& frame) noexcept;

  Batch<kReceived> received_;
  std::array<ControlBuffer, kReceived> controls_;
  std::array<sockaddr_in, kReceived> sources_;
  Batch<kSent> sent_;
  int64_t lost_before_ = 0;  // by receivers that are closed
};

}  // namespace plumb
