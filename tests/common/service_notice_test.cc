#include "common/service_notice.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <catch2/catch.hpp>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>

namespace plumb {
namespace {

/// The service manager's side, and the environment in which it starts a process.
class Manager {
 public:
  Manager() : name_("@plumbline service_notice_test " + std::to_string(getpid())) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path + 1, name_.data() + 1, name_.size() - 1);
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name_.size());
    REQUIRE(bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), size) == 0);
    setenv("NOTIFY_SOCKET", name_.c_str(), 1);
  }
  ~Manager() {
    for (const char* name : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) unsetenv(name);
  }

  /// The next datagram; "" = there is none.
  std::string Heard() {
    std::array<char, 100> buffer;
    const ssize_t size = recv(socket_.get(), buffer.data(), buffer.size(), 0);
    return size < 0 ? "" : std::string(buffer.data(), static_cast<size_t>(size));
  }

 private:
  FileDescriptor socket_{socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)};
  std::string name_;
};

TEST_CASE("a service manager hears once that a process is ready, and once that it stops") {
  Manager manager;
  ServiceNotice notice;
  CHECK(manager.Heard().empty());
  notice.Alive();
  notice.Alive();
  CHECK(manager.Heard() == "READY=1");
  CHECK(manager.Heard().empty());  // nobody has asked for a watchdog
  notice.Stopping();
  notice.Stopping();
  CHECK(manager.Heard() == "STOPPING=1");
  CHECK(manager.Heard().empty());
}

TEST_CASE("a service manager's watchdog is told in half of its time that a process is at work") {
  Manager manager;
  setenv("WATCHDOG_USEC", "2000", 1);
  setenv("WATCHDOG_PID", std::to_string(getpid()).c_str(), 1);
  ServiceNotice notice;
  notice.Alive();
  CHECK(manager.Heard() == "READY=1");
  CHECK(manager.Heard() == "WATCHDOG=1");
  std::this_thread::sleep_for(std::chrono::milliseconds(1));
  notice.Alive();
  CHECK(manager.Heard() == "WATCHDOG=1");
}

TEST_CASE(
    "a service manager's watchdog of another process, or of a time that is none, is not fed") {
  Manager manager;
  const std::string mine = std::to_string(getpid());
  for (const auto& [time, process] :
       {std::pair{"1", "1"}, {"-1", mine.c_str()}, {"1x", mine.c_str()}}) {
    setenv("WATCHDOG_USEC", time, 1);
    setenv("WATCHDOG_PID", process, 1);
    ServiceNotice notice;
    notice.Alive();
    CHECK(manager.Heard() == "READY=1");
    CHECK(manager.Heard().empty());
  }
}

TEST_CASE(
    "without a service manager, or with one that is gone, nothing is said and nothing fails") {
  ServiceNotice nobody;
  nobody.Alive(), nobody.Stopping();
  for (const char* name : {"", "@", "relative", "/nonexistent/socket"}) {
    setenv("NOTIFY_SOCKET", name, 1);
    ServiceNotice gone;
    gone.Alive(), gone.Stopping();
  }
  setenv("NOTIFY_SOCKET", std::string(200, '/').c_str(), 1);
  ServiceNotice too_long;
  too_long.Alive();
  unsetenv("NOTIFY_SOCKET");
}

}  // namespace
}  // namespace plumb
