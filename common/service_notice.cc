#include "common/service_notice.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <charconv>
#include <chrono>
#include <cstddef>
#include <cstdlib>
#include <cstring>

namespace plumb {
namespace {

int64_t Nanoseconds() {
  return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// A whole number > 0 of the environment; 0 = there is none.
int64_t FromEnvironment(const char* name) {
  const char* const text = std::getenv(name);
  int64_t number = 0;
  if (!text) return 0;
  const char* const end = text + std::strlen(text);
  const auto [last, error] = std::from_chars(text, end, number);
  return error == std::errc() && last == end && number > 0 ? number : 0;
}

/// A path, or after an @ a name in the abstract namespace, unix(7).
FileDescriptor Connect(std::string_view name) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (name.size() < 2 || name.size() >= sizeof address.sun_path || !strchr("/@", name[0]))
    return {};
  std::memcpy(address.sun_path, name.data(), name.size());
  if (name[0] == '@') address.sun_path[0] = '\0';
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
  FileDescriptor socket(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (connect(socket.get(), reinterpret_cast<const sockaddr*>(&address), size) != 0) return {};
  return socket;
}

}  // namespace

ServiceNotice::ServiceNotice() {
  const char* const name = std::getenv("NOTIFY_SOCKET");
  if (!name) return;
  socket_ = Connect(name);
  const int64_t pid = FromEnvironment("WATCHDOG_PID");
  if (pid == 0 || pid == getpid()) period_ = FromEnvironment("WATCHDOG_USEC") * 1000 / 2;
}

void ServiceNotice::Stopping() {
  if (!socket_.valid() || stopping_) return;
  stopping_ = true;
  Say("STOPPING=1");
}

void ServiceNotice::Tell() {
  if (!ready_) {
    ready_ = true;
    Say("READY=1");
  }
  if (period_ == 0) return;
  const int64_t now = Nanoseconds();
  if (now < next_) return;
  next_ = now + period_;
  Say("WATCHDOG=1");
}

// What does not get through is not said again: the manager is told in half a period, or is gone.
void ServiceNotice::Say(std::string_view what) {
  send(socket_.get(), what.data(), what.size(), MSG_NOSIGNAL);
}

}  // namespace plumb
