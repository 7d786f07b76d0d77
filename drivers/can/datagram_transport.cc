#include "drivers/can/datagram_transport.h"

#include <algorithm>
#include <cerrno>
#include <utility>

namespace plumb {
namespace {

/// Datagrams that one call of Receive looks at, echoes, malformed and unwanted ones included.
constexpr size_t kMaxExamined = 128;

}  // namespace

DatagramTransport::DatagramTransport(std::vector<Filter> filters) : Transport(std::move(filters)) {
  for (size_t i = 0; i < kReceived; ++i) received_.messages[i].msg_hdr.msg_name = &sources_[i];
}

int DatagramTransport::Send(std::span<const Frame> frames) noexcept {
  size_t sent = 0;
  while (sent < frames.size() && may_send()) {
    const size_t size = std::min(frames.size() - sent, kSent);
    for (size_t i = 0; i < size; ++i) {
      sent_.parts[i].iov_len = Encode(frames[sent + i], sent_.buffers[i]);
    }
    const int accepted =
        sendmmsg(sender(), sent_.messages.data(), static_cast<unsigned>(size), MSG_NOSIGNAL);
    if (accepted < 0) {
      OnSendError(errno);
      break;
    }
    sent += static_cast<size_t>(accepted);
    // Not again: behind a frame that was refused nothing may go out, or the order is lost.
    if (static_cast<size_t>(accepted) < size) break;
  }
  stats_.sent += static_cast<int64_t>(sent);
  stats_.refused += static_cast<int64_t>(frames.size() - sent);
  return static_cast<int>(sent);
}

int DatagramTransport::Receive(std::span<Frame> frames) noexcept {
  size_t count = 0;
  // Datagrams that are not handed out count, too: a flood of them must not keep us.
  for (size_t left = kMaxExamined; left > 0 && count < frames.size();) {
    const size_t room = std::min({frames.size() - count, kReceived, left});
    for (size_t i = 0; i < room; ++i) {
      msghdr& header = received_.messages[i].msg_hdr;
      header.msg_namelen = sizeof sources_[i];
      header.msg_control = controls_[i].bytes;
      header.msg_controllen = sizeof controls_[i].bytes;
      header.msg_flags = 0;
    }
    const int got =
        recvmmsg(receiver(), received_.messages.data(), static_cast<unsigned>(room), 0, nullptr);
    if (got < 0) {
      OnReceiveError(errno);
      break;
    }
    left -= static_cast<size_t>(got);
    for (int i = 0; i < got; ++i) {
      if (Take(static_cast<size_t>(i), frames[count])) ++count;
    }
    if (static_cast<size_t>(got) < room) break;
  }
  stats_.received += static_cast<int64_t>(count);
  return static_cast<int>(count);
}

/// @return false for what is not to be handed out.
bool DatagramTransport::Take(size_t index, Frame& frame) noexcept {
  const mmsghdr& message = received_.messages[index];
  const ReceiveControl control = ReadControl(message.msg_hdr);
  if (control.overflow) stats_.lost = lost_before_ + *control.overflow;
  const Datagram datagram{std::span(received_.buffers[index]).first(message.msg_len),
                          sources_[index], message.msg_hdr.msg_flags};
  if (IsEcho(datagram)) {
    ++stats_.echoes;
    return false;
  }
  if ((datagram.flags & MSG_TRUNC) != 0 || !Decode(datagram.bytes, frame)) {
    ++stats_.malformed;
    return false;
  }
  if (!Passes(frame)) return false;
  frame.receive_ns = control.receive_ns;
  frame.foreign = IsOurs(frame);
  if (frame.foreign) ++stats_.foreign;
  return true;
}

}  // namespace plumb
