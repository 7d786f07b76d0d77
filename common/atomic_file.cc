#include "common/atomic_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <stdexcept>

namespace plumb {

void WriteAtomically(const std::filesystem::path& file, const std::string& content) {
  const std::string temporary = file.string() + ".part";
  const int fd = open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  bool ok = fd >= 0;
  for (size_t done = 0; ok && done < content.size();) {
    const ssize_t written = write(fd, content.data() + done, content.size() - done);
    ok = written > 0;
    if (ok) done += static_cast<size_t>(written);
  }
  ok = ok && fsync(fd) == 0;
  if (fd >= 0) close(fd);
  if (!ok || rename(temporary.c_str(), file.c_str()) != 0) throw std::runtime_error(file.string() + ": cannot be written");
}

}  // namespace plumb
