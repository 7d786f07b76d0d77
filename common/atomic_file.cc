#include "common/atomic_file.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <functional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

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

// Names nobody else gives: of this file, and of this process.
constexpr char kPart[] = ".part-";

struct Temporary {
  int fd = -1;
  std::string name;
};

// What is there already, a link among it, is somebody else's: left alone, and not written through.
Temporary MakeTemporary(const std::filesystem::path& file) {
  constexpr int kMostTries = 100;
  Temporary temporary;
  for (int i = 0; i < kMostTries; ++i) {
    temporary.name = file.string() + kPart + std::to_string(getpid());
    if (i > 0) temporary.name += "-" + std::to_string(i);
    temporary.fd =
        open(temporary.name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644);
    if (temporary.fd >= 0 || errno != EEXIST) break;
  }
  return temporary;
}

// Whether it is a temporary file of ours, of a process that is no more. @param number how its name
// goes on behind ".part-".
bool IsLeftover(const std::filesystem::path& file, std::string_view number) {
  pid_t pid = 0;
  const char *const begin = number.data(), *const end = begin + number.size();
  const char* const rest = std::from_chars(begin, end, pid).ptr;
  struct stat status {};
  const bool ours = rest != begin && (rest == end || *rest == '-') && pid > 0 &&
                    lstat(file.c_str(), &status) == 0 && S_ISREG(status.st_mode) &&
                    status.st_uid == geteuid();
  return ours && kill(pid, 0) != 0 && errno == ESRCH;
}

// @param of whether they are of this file, by its name
void RemoveLeftoversOf(const std::filesystem::path& folder,
                       const std::function<bool(std::string_view file)>& of) {
  namespace fs = std::filesystem;
  std::error_code ignored;  // of what cannot be removed nobody is worse off
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, ignored)) {
    const std::string name = entry.path().filename().string();
    const size_t part = name.rfind(kPart);
    if (part == std::string::npos) continue;
    const std::string_view file(name.data(), part);
    if (of(file) && IsLeftover(entry.path(), name.substr(part + std::strlen(kPart))))
      fs::remove(entry.path(), ignored);
  }
}

}  // namespace

AtomicFile::AtomicFile(std::filesystem::path file) : file_(std::move(file)) {
  Temporary temporary = MakeTemporary(file_);
  if (temporary.fd < 0) Fail(errno);
  fd_ = FileDescriptor(temporary.fd);
  temporary_ = std::move(temporary.name);
}

AtomicFile::AtomicFile(AtomicFile&& other) noexcept
    : file_(std::move(other.file_)),
      fd_(std::move(other.fd_)),
      temporary_(std::exchange(other.temporary_, {})),
      buffer_(std::move(other.buffer_)) {}

AtomicFile::~AtomicFile() {
  if (!temporary_.empty()) unlink(temporary_.c_str());
}

void AtomicFile::Fail(int error) const {
  throw std::runtime_error(file_.string() + ": cannot be written: " + std::strerror(error));
}

void AtomicFile::Write(std::string_view bytes) {
  constexpr size_t kBuffer = size_t{64} << 10;
  buffer_ += bytes;
  if (buffer_.size() >= kBuffer) WriteOut();
}

void AtomicFile::WriteOut() {
  if (!WriteAll(fd_.get(), buffer_)) Fail(errno);
  buffer_.clear();
}

void AtomicFile::Commit() {
  WriteOut();
  if (fsync(fd_.get()) != 0 || rename(temporary_.c_str(), file_.c_str()) != 0) Fail(errno);
  temporary_.clear();
  fd_ = {};
  if (!SyncFolder(file_)) Fail(errno);
}

void WriteAtomically(const std::filesystem::path& file, std::string_view content) {
  AtomicFile atomic(file);
  atomic.Write(content);
  atomic.Commit();
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
  RemoveLeftoversOf(file.has_parent_path() ? file.parent_path() : ".",
                    [name = file.filename().string()](std::string_view of) { return of == name; });
  const Temporary temporary = MakeTemporary(file);
  if (temporary.fd < 0) fail(std::strerror(errno));
  close(temporary.fd);
  unlink(temporary.name.c_str());
}

void MakeFolder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw std::runtime_error(folder.string() + ": cannot be made: " + error.message());
}

void RemoveLeftovers(const std::filesystem::path& folder, const std::string& extension) {
  RemoveLeftoversOf(folder, [&](std::string_view file) { return file.ends_with(extension); });
}

}  // namespace plumb
