#include "common/process_number.h"

#include <fcntl.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace plumb {
namespace {

constexpr int kStartTime = 22;  // its field in /proc/PID/stat, counted from 1
constexpr int kIdBits = 22;

}  // namespace

int64_t ProcessNumber(pid_t pid) noexcept {
  std::array<char, 1024> text{};
  std::snprintf(text.data(), text.size(), "/proc/%d/stat", static_cast<int>(pid));
  const int fd = open(text.data(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return 0;
  const ssize_t size = read(fd, text.data(), text.size() - 1);
  close(fd);
  if (size <= 0) return 0;
  text[static_cast<size_t>(size)] = '\0';
  // The second field is the name, in parentheses, which may hold anything.
  const char* at = std::strrchr(text.data(), ')');
  // Dead already, though its parent has not asked for its end yet.
  if (at && (std::strncmp(at, ") Z", 3) == 0 || std::strncmp(at, ") X", 3) == 0)) return 0;
  for (int field = 2; at && field < kStartTime; ++field) {
    at = std::strchr(at, ' ');
    if (at) ++at;
  }
  if (!at) return 0;
  return static_cast<int64_t>(std::strtoull(at, nullptr, 10) << kIdBits) | pid;
}

bool Runs(int64_t number) noexcept {
  return number != 0 && ProcessNumber(ProcessId(number)) == number;
}

}  // namespace plumb
