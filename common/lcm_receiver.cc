#include "common/lcm_receiver.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <system_error>
#include <utility>

#include "common/clock.h"
#include "common/own_machine.h"

namespace plumb {
namespace {

constexpr size_t kMaxDatagram = 65536;
constexpr int kBurst = 64;  // datagrams between two looks at whether to stop
// Of a message in a queue, beyond its bytes: what the containers take.
constexpr size_t kOverhead = 128;

[[noreturn]] void FailWithErrno(const char* what) {
  throw std::system_error(errno, std::generic_category(), what);
}

template <class Value>
void SetOption(int fd, int level, int option, const Value& value, const char* what) {
  if (setsockopt(fd, level, option, &value, sizeof value) != 0) FailWithErrno(what);
}

/// The descriptor is not readable any more.
void NoneWaits(int event_fd) {
  eventfd_t ignored;
  eventfd_read(event_fd, &ignored);
}

}  // namespace

class LcmReceiver::Queue {
 public:
  struct Message {
    uint64_t number;  // in the order of arrival, in all queues
    std::string channel;
    std::vector<uint8_t> data;
    int64_t arrival;  // monotonic [us]
    size_t cost() const { return data.size() + kOverhead; }
  };

  Queue(std::string channel, Handler handler)
      : channel_(std::move(channel)), handler_(std::move(handler)) {}

  bool Wants(std::string_view channel) const { return channel_ == ".*" || channel_ == channel; }
  /// @return how many older ones had to go.
  size_t Push(Message message) {
    cost_ += message.cost();
    messages_.push_back(std::move(message));
    size_t dropped = 0;
    for (; cost_ > kMaxQueued; ++dropped) Pop();
    lost_ += static_cast<int64_t>(dropped);
    return dropped;
  }
  Message Pop() {
    Message message = std::move(messages_.front());
    messages_.pop_front();
    cost_ -= message.cost();
    return message;
  }
  const std::deque<Message>& messages() const { return messages_; }
  void Handle(const Message& message) const { handler_(message.channel, message.data); }
  Loss TakeLoss() { return {channel_, std::exchange(lost_, 0)}; }

 private:
  const std::string channel_;
  const Handler handler_;
  std::deque<Message> messages_;
  size_t cost_ = 0;
  int64_t lost_ = 0;
};

LcmReceiver::LcmReceiver(const MulticastAddress& address)
    : socket_(socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)),
      waiting_fd_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)),
      stop_fd_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)),
      datagrams_([this](std::string_view channel) { return Wanted(channel); }) {
  if (!socket_.valid() || !waiting_fd_.valid() || !stop_fd_.valid())
    FailWithErrno("cannot open a socket");
  Open(address);
  thread_ = std::thread([this] { Work(); });
}

LcmReceiver::~LcmReceiver() { StopWork(); }

void LcmReceiver::StopWork() {
  if (!thread_.joinable()) return;
  eventfd_write(stop_fd_.get(), 1);
  thread_.join();
}

void LcmReceiver::Leave() {
  // Nothing comes any more, so that there is an end to what is left in the socket.
  setsockopt(socket_.get(), IPPROTO_IP, IP_DROP_MEMBERSHIP, &membership_, sizeof membership_);
  StopWork();
  std::vector<uint8_t> buffer(kMaxDatagram);
  while (Receive(buffer)) {
  }
}

/// Everything that keeps datagrams out comes before the socket has a port.
void LcmReceiver::Open(const MulticastAddress& address) {
  const int fd = socket_.get();
  if (address.ttl == 0) AdmitOwnMachineOnly(fd);
  // Without this a socket hears every group that anybody on the machine has joined.
  SetOption(fd, IPPROTO_IP, IP_MULTICAST_ALL, 0, "IP_MULTICAST_ALL");
  SetOption(fd, SOL_SOCKET, SO_REUSEADDR, 1, "SO_REUSEADDR");
  if (address.receive_buffer > 0)
    SetOption(fd, SOL_SOCKET, SO_RCVBUF, address.receive_buffer, "SO_RCVBUF");
  // Bound to the group and not to all addresses, a socket gets no datagrams to any other one.
  sockaddr_in group{};
  group.sin_family = AF_INET;
  group.sin_port = htons(address.port);
  inet_pton(AF_INET, address.group.c_str(), &group.sin_addr);
  if (bind(fd, reinterpret_cast<const sockaddr*>(&group), sizeof group) != 0)
    FailWithErrno("cannot bind LCM's port");
  membership_.imr_multiaddr = group.sin_addr;  // by the interface that the routes choose
  SetOption(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, membership_, "cannot join LCM's group");
}

LcmReceiver::Queue* LcmReceiver::Listen(const std::string& channel, Handler handler) {
  const std::lock_guard lock(mutex_);
  return &queues_.emplace_back(channel, std::move(handler));
}

void LcmReceiver::Forget(Queue* queue) {
  const std::lock_guard lock(mutex_);
  waiting_ -= queue->messages().size();
  queues_.remove_if([&](const Queue& candidate) { return &candidate == queue; });
  if (waiting_ == 0) NoneWaits(waiting_fd_.get());
}

int LcmReceiver::Drain(int max_messages) {
  std::unique_lock lock(mutex_);
  // Not those that come meanwhile: a flood must not keep the caller for ever.
  const size_t present = std::min(waiting_, static_cast<size_t>(std::max(max_messages, 0)));
  size_t handled = 0;
  for (; handled < present && waiting_ > 0; ++handled) {
    Queue* const queue = Oldest();
    const Queue::Message message = queue->Pop();
    --waiting_;
    arrival_ = message.arrival;
    lock.unlock();
    queue->Handle(message);
    lock.lock();
  }
  if (waiting_ == 0) NoneWaits(waiting_fd_.get());
  return static_cast<int>(handled);
}

std::vector<LcmReceiver::Loss> LcmReceiver::TakeLosses() {
  const std::lock_guard lock(mutex_);
  std::vector<Loss> losses;
  for (Queue& queue : queues_) losses.push_back(queue.TakeLoss());
  std::erase_if(losses, [](const Loss& loss) { return loss.messages == 0; });
  return losses;
}

void LcmReceiver::Work() {
  std::vector<uint8_t> buffer(kMaxDatagram);
  std::array<pollfd, 2> polled{{{socket_.get(), POLLIN, 0}, {stop_fd_.get(), POLLIN, 0}}};
  for (;;) {
    poll(polled.data(), polled.size(), -1);
    if (polled[1].revents != 0) return;
    if (polled[0].revents != 0) Receive(buffer);
  }
}

// A burst. False: none is left.
bool LcmReceiver::Receive(std::span<uint8_t> buffer) {
  for (int i = 0; i < kBurst; ++i) {
    sockaddr_in from{};
    socklen_t length = sizeof from;
    const ssize_t size = recvfrom(socket_.get(), buffer.data(), buffer.size(), 0,
                                  reinterpret_cast<sockaddr*>(&from), &length);
    if (size < 0) return false;
    const uint64_t sender = uint64_t{from.sin_addr.s_addr} << 16 | from.sin_port;
    const std::lock_guard lock(mutex_);
    if (const auto message = datagrams_.Take(sender, buffer.first(static_cast<size_t>(size))))
      Keep(*message);
  }
  return true;
}

void LcmReceiver::Keep(const LcmDatagrams::Message& message) {
  const uint64_t number = ++arrived_;
  const bool none_waited = waiting_ == 0;
  for (Queue& queue : queues_) {
    if (!queue.Wants(message.channel)) continue;
    ++waiting_;
    waiting_ -= queue.Push({number,
                            std::string(message.channel),
                            {message.data.begin(), message.data.end()},
                            Clock().Now()});
  }
  if (none_waited && waiting_ > 0) eventfd_write(waiting_fd_.get(), 1);
}

bool LcmReceiver::Wanted(std::string_view channel) const {
  return std::ranges::any_of(queues_, [&](const Queue& queue) { return queue.Wants(channel); });
}

LcmReceiver::Queue* LcmReceiver::Oldest() {
  Queue* oldest = nullptr;
  for (Queue& queue : queues_) {
    if (queue.messages().empty()) continue;
    if (!oldest || queue.messages().front().number < oldest->messages().front().number)
      oldest = &queue;
  }
  return oldest;
}

}  // namespace plumb
