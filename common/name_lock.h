#pragma once

#include <filesystem>
#include <string>

namespace plumb {

/// Something on this machine that one process may have at a time, by its name: a bus, an LCM group,
/// a file. Whoever has it loses it with its life, whatever ends that. The network namespace counts
/// as the machine, as it does for buses and groups. Not thread-safe.
class NameLock {
 public:
  /// @param name e.g. "bus udp:239.74.163.2:43113"; of any length.
  /// @throws std::runtime_error with `otherwise` if another process, or this one, has it.
  NameLock(const std::string& name, const std::string& otherwise);
  ~NameLock();
  NameLock(const NameLock&) = delete;
  NameLock& operator=(const NameLock&) = delete;

 private:
  int fd_;
};

/// A file's or folder's name for a lock, whether it is there or not: the same from wherever, and
/// however, its path is given. Thread-safe.
std::string NameOfFile(const std::filesystem::path& file);

}  // namespace plumb
