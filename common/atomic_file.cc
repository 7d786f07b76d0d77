#include "common/atomic_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>
#include <system_error>

namespace plumb {
namespace {

bool WriteAll(int fd, std::string_view content) {
  while (!content.empty()) {
    const ssize_t written = write(fd, content.data(), content.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    content.remove_prefix(static_cast<size_t>(written));
  }
  return true;
}

// A rename is safe from a power cut only when the folder that holds the name is on the disk.
bool SyncFolder(const std::filesystem::path& file) {
  const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : ".";
  const int fd = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const bool ok = fd >= 0 && fsync(fd) == 0;
  if (fd >= 0) close(fd);
  return ok;
}

std::string Temporary(const std::filesystem::path& file) { return file.string() + ".part"; }

}  // namespace

void WriteAtomically(const std::filesystem::path& file, std::string_view content) {
  const std::string temporary = Temporary(file);
  const int fd = open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  bool ok = fd >= 0 && WriteAll(fd, content) && fsync(fd) == 0;
  const int error = errno;
  if (fd >= 0) close(fd);
  if (!ok) throw std::runtime_error(file.string() + ": cannot be written: " + std::strerror(error));
  ok = rename(temporary.c_str(), file.c_str()) == 0 && SyncFolder(file);
  if (!ok) throw std::runtime_error(file.string() + ": cannot be written: " + std::strerror(errno));
}

void RequireWritable(const std::filesystem::path& file) {
  const auto fail = [&](const std::string& why) {
    throw std::runtime_error(file.string() + ": cannot be written: " + why);
  };
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(file, error);
  if (std::filesystem::is_directory(status) || !file.has_filename()) fail("it is a folder");
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status))
    fail("it is not a regular file");
  const std::string temporary = Temporary(file);
  // Without waiting, should that be a pipe.
  const int fd = open(temporary.c_str(), O_WRONLY | O_CREAT | O_NONBLOCK | O_CLOEXEC, 0644);
  if (fd < 0) fail(std::strerror(errno));
  close(fd);
  unlink(temporary.c_str());
}

}  // namespace plumb
