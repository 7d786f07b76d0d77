#include "common/lockstep/packet_socket.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <utility>

namespace plumb {
namespace {

constexpr size_t kLengthSize = sizeof(uint32_t);
constexpr size_t kChunk = size_t{1} << 16;  // [bytes] sent in one go
constexpr timeval kSoon{0, 100'000};        // for which a Read waits, at most

[[noreturn]] void Fail(const std::string& path, const char* what) {
  throw std::runtime_error(fmt::format("{}: {} ({})", path, what, std::strerror(errno)));
}

/// Chunks, rather than a stream: who waits in a blocking recv on a stream is woken, for nothing,
/// when the other end reads what was sent before.
PacketSocket MakeSocket(int flags) {
  return PacketSocket(socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | flags, 0));
}

void LimitWaiting(const PacketSocket& socket) {
  if (socket.open()) setsockopt(socket.fd(), SOL_SOCKET, SO_RCVTIMEO, &kSoon, sizeof kSoon);
}

/// An address has room for 107 bytes only, a path may be longer: its folder is opened, and named by
/// number.
struct Address {
  explicit Address(const std::string& path) {
    const std::filesystem::path file(path);
    const std::string folder = file.has_parent_path() ? file.parent_path().string() : ".";
    directory = open(folder.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC);
    if (directory < 0) Fail(folder, "cannot open the folder");
    const std::string text =
        fmt::format("/proc/self/fd/{}/{}", directory, file.filename().string());
    if (text.size() >= sizeof name.sun_path) {
      errno = ENAMETOOLONG;
      Fail(path, "cannot name a socket");
    }
    name.sun_family = AF_UNIX;
    std::memcpy(name.sun_path, text.c_str(), text.size() + 1);
  }
  ~Address() { close(directory); }
  Address(const Address&) = delete;
  Address& operator=(const Address&) = delete;
  const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&name); }

  sockaddr_un name{};
  int directory;
};

}  // namespace

PacketSocket::PacketSocket(PacketSocket&& other) noexcept { *this = std::move(other); }

PacketSocket& PacketSocket::operator=(PacketSocket&& other) noexcept {
  std::swap(fd_, other.fd_);
  std::swap(in_, other.in_);
  std::swap(out_, other.out_);
  std::swap(begin_, other.begin_);
  std::swap(end_, other.end_);
  return *this;
}

PacketSocket::~PacketSocket() { Close(); }

void PacketSocket::Close() {
  if (fd_ >= 0) close(std::exchange(fd_, -1));
}

PacketSocket PacketSocket::Listen(const std::string& path) {
  struct stat known {};
  if (lstat(path.c_str(), &known) == 0 && !S_ISSOCK(known.st_mode))
    throw std::runtime_error(path + ": is there and no socket of ours: it is not removed");
  unlink(path.c_str());  // of a run that was killed; a living one holds the folder's lock
  PacketSocket socket = MakeSocket(SOCK_NONBLOCK);
  const Address address(path);
  if (!socket.open() || bind(socket.fd(), address.get(), sizeof address.name) != 0 ||
      listen(socket.fd(), 64) != 0) {
    Fail(path, "cannot make a socket");
  }
  return socket;
}

PacketSocket PacketSocket::Connect(const std::string& path) {
  PacketSocket socket = MakeSocket(0);
  const Address address(path);
  if (!socket.open() || connect(socket.fd(), address.get(), sizeof address.name) != 0) {
    Fail(path, "nobody keeps a run's time there");
  }
  LimitWaiting(socket);
  return socket;
}

PacketSocket PacketSocket::Accept() const {
  PacketSocket socket(accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC));
  LimitWaiting(socket);
  return socket;
}

bool PacketSocket::Send(std::span<const uint8_t> packet, const std::function<bool()>& waiting) {
  const auto length = static_cast<uint32_t>(packet.size());
  out_.resize(kLengthSize + packet.size());
  std::memcpy(out_.data(), &length, kLengthSize);
  if (!packet.empty()) std::memcpy(out_.data() + kLengthSize, packet.data(), packet.size());
  for (size_t sent = 0; sent < out_.size();) {
    const size_t size = std::min(kChunk, out_.size() - sent);
    const ssize_t n = send(fd_, out_.data() + sent, size, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (n > 0) {
      sent += static_cast<size_t>(n);
    } else if (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR) {
      pollfd writable{fd_, POLLOUT, 0};
      if (poll(&writable, 1, 100) == 0 && waiting && !waiting()) return false;
    } else {
      return false;
    }
  }
  return true;
}

bool PacketSocket::Read(When when) {
  for (bool more = true; more;) {
    if (begin_ == end_) begin_ = end_ = 0;
    if (in_.size() - end_ < kChunk) in_.resize(end_ + kChunk);
    const ssize_t n = recv(fd_, in_.data() + end_, kChunk, when == When::kNow ? MSG_DONTWAIT : 0);
    if (n < 0) return errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
    if (n == 0) return false;
    end_ += static_cast<size_t>(n);
    const size_t length = Length();
    if (length == 0 || length > kLongest) return end_ - begin_ < kLengthSize;
    more = static_cast<size_t>(n) == kChunk;
    when = When::kNow;
  }
  return true;
}

size_t PacketSocket::Length() const {
  uint32_t length = 0;
  if (end_ - begin_ >= kLengthSize) std::memcpy(&length, in_.data() + begin_, kLengthSize);
  return length;
}

std::span<const uint8_t> PacketSocket::Next() {
  const size_t length = Length();
  if (length == 0 || end_ - begin_ - kLengthSize < length) return {};
  const std::span<const uint8_t> packet = std::span(in_).subspan(begin_ + kLengthSize, length);
  begin_ += kLengthSize + length;
  return packet;
}

}  // namespace plumb
