#include "drivers/can/loop.h"

#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <map>
#include <mutex>
#include <stdexcept>

namespace plumb {
namespace {

class LoopTransport;

/// Who is on which bus.
struct Registry {
  std::mutex mutex;
  std::map<std::string, std::vector<LoopTransport*>> buses;
};

Registry& TheRegistry() {
  static Registry registry;
  return registry;
}

int64_t RealtimeNs() noexcept {
  timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  return int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

/// Frames wait in a socket pair: the kernel gives us a bounded queue that can be polled.
class LoopTransport : public Transport {
 public:
  LoopTransport(const std::string& name, std::vector<Filter> filters)
      : Transport(std::move(filters)), name_(name) {
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, sockets_) != 0) {
      throw std::runtime_error("loop:" + name +
                               ": cannot create a socket pair (too many open files?)");
    }
    const int bytes = 1 << 20;
    setsockopt(sockets_[1], SOL_SOCKET, SO_SNDBUF, &bytes, sizeof bytes);
    const std::lock_guard lock(TheRegistry().mutex);
    TheRegistry().buses[name].push_back(this);
  }

  ~LoopTransport() override {
    {
      const std::lock_guard lock(TheRegistry().mutex);
      auto& members = TheRegistry().buses[name_];
      std::erase(members, this);
      if (members.empty()) TheRegistry().buses.erase(name_);
    }
    close(sockets_[0]);
    close(sockets_[1]);
  }

  int fd() const noexcept override { return sockets_[0]; }
  void SetTime(int64_t now) noexcept override { virtual_ns_ = now * 1000; }

  int Send(std::span<const Frame> frames) noexcept override {
    const int64_t stamp = virtual_ns_ == kNever ? RealtimeNs() : virtual_ns_;
    Registry& registry = TheRegistry();
    const std::lock_guard lock(registry.mutex);
    const auto bus = registry.buses.find(name_);
    for (Frame frame : frames) {
      frame.receive_ns = stamp;
      frame.foreign = false;
      for (LoopTransport* member : bus->second) {
        if (member != this) member->Deliver(frame);
      }
    }
    stats_.sent += static_cast<int64_t>(frames.size());
    return static_cast<int>(frames.size());
  }

  int Receive(std::span<Frame> frames) noexcept override {
    int count = 0;
    while (static_cast<size_t>(count) < frames.size() &&
           recv(sockets_[0], &frames[static_cast<size_t>(count)], sizeof(Frame), 0) ==
               sizeof(Frame)) {
      Frame& frame = frames[static_cast<size_t>(count++)];
      frame.foreign = IsOurs(frame);
      if (frame.foreign) ++stats_.foreign;
    }
    stats_.received += count;
    stats_.lost = overflows_;
    return count;
  }

 private:
  void Deliver(const Frame& frame) noexcept {
    if (Passes(frame) && send(sockets_[1], &frame, sizeof frame, MSG_NOSIGNAL) != sizeof frame)
      ++overflows_;
  }

  std::string name_;
  int sockets_[2];
  int64_t virtual_ns_ = kNever;
  std::atomic<int64_t> overflows_ = 0;
};

}  // namespace

std::unique_ptr<Transport> OpenLoop(const std::string& name, std::vector<Filter> filters) {
  return std::make_unique<LoopTransport>(name, std::move(filters));
}

}  // namespace plumb
