#pragma once

#include <filesystem>

namespace plumb {

/// Keeps a run's folder for one process at a time, for as long as it lives. Not thread-safe.
class FolderLock {
 public:
  /// @throws std::runtime_error naming the folder and who has it.
  explicit FolderLock(const std::filesystem::path& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int fd_;
};

}  // namespace plumb
