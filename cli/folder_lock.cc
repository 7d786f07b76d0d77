#include "cli/folder_lock.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>

namespace plumb {

FolderLock::FolderLock(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / "lock";
  fd_ = open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (fd_ < 0) throw std::runtime_error(fmt::format("{}: {}", file.string(), std::strerror(errno)));
  if (flock(fd_, LOCK_EX | LOCK_NB) != 0) {
    std::string owner = "another run";
    std::ifstream(file) >> owner;
    close(fd_);
    throw std::runtime_error(
        fmt::format("{}: in use by process {}; give another --output", folder.string(), owner));
  }
  const std::string owner = std::to_string(getpid()) + "\n";
  if (ftruncate(fd_, 0) != 0 || write(fd_, owner.data(), owner.size()) < 0) {
    close(fd_);
    throw std::runtime_error(fmt::format("{}: {}", file.string(), std::strerror(errno)));
  }
}

FolderLock::~FolderLock() { close(fd_); }

}  // namespace plumb
