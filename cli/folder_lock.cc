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

namespace {

bool IsNumber(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
}

}  // namespace

FolderLock::FolderLock(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / "lock";
  fd_ = open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
  if (fd_ < 0) throw std::runtime_error(fmt::format("{}: {}", file.string(), std::strerror(errno)));
  if (flock(fd_, LOCK_EX | LOCK_NB) != 0) {
    std::string owner = "another run";
    std::ifstream(file) >> owner;
    close(fd_);
    throw std::runtime_error(
        fmt::format("{}: in use by process {}; give another --output", folder.string(), owner));
  }
  // Of a run that has ended it holds a number, and of one that has just begun nothing.
  if (std::string known; std::getline(std::ifstream(file), known) && !IsNumber(known)) {
    close(fd_);
    throw std::runtime_error(file.string() + ": is there and no run's: it is not written over");
  }
  const std::string owner = std::to_string(getpid()) + "\n";
  if (ftruncate(fd_, 0) != 0 || write(fd_, owner.data(), owner.size()) < 0) {
    close(fd_);
    throw std::runtime_error(fmt::format("{}: {}", file.string(), std::strerror(errno)));
  }
}

FolderLock::~FolderLock() { close(fd_); }

}  // namespace plumb
