#include "common/name_lock.h"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <stdexcept>

#include "common/hash.h"

namespace plumb {

// A Unix socket in the abstract namespace, unix(7): the kernel gives a name to one socket at a time
// and takes it back when that is closed.
NameLock::NameLock(const std::string& name, const std::string& otherwise)
    : fd_(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
  const auto fail = [&](const std::string& why) {
    if (fd_ >= 0) close(fd_);
    throw std::runtime_error(why);
  };
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string path = fmt::format("plumbline {:016x}", Hash(name));
  std::memcpy(address.sun_path + 1, path.data(), path.size());
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + path.size());
  if (fd_ >= 0 && bind(fd_, reinterpret_cast<const sockaddr*>(&address), size) == 0) return;
  fail(errno == EADDRINUSE ? otherwise : name + ": cannot be locked: " + std::strerror(errno));
}

NameLock::~NameLock() { close(fd_); }

// Of what is not there a path that is relative would stay so.
std::string NameOfFile(const std::filesystem::path& file) {
  return std::filesystem::weakly_canonical(std::filesystem::absolute(file)).string();
}

}  // namespace plumb
