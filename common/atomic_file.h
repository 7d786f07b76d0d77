#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "common/file_descriptor.h"

namespace plumb {

/// Writes a file so that a reader sees the old or the new content, never a part, whenever the
/// process or the machine dies: temporary file beside it (its name, ".part-" and the process's
/// number), fsync, rename. Thread-safe for different files. @throws std::runtime_error naming the
/// file and the cause.
void WriteAtomically(const std::filesystem::path& file, std::string_view content);

/// The same for a file that is written bit by bit, and is there once it is committed. What is not
/// committed is gone with this. Not thread-safe.
class AtomicFile {
 public:
  /// @throws std::runtime_error naming the file and the cause, as all that follows.
  explicit AtomicFile(std::filesystem::path file);
  ~AtomicFile();
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&&) = delete;

  void Write(std::string_view bytes);
  void Commit();

 private:
  [[noreturn]] void Fail(int error) const;
  void WriteOut();

  std::filesystem::path file_;
  FileDescriptor fd_;
  std::string temporary_;  // its name; empty once it is no more
  std::string buffer_;
};

/// Looks whether WriteAtomically could write the file, before a long computation rather than after
/// it: makes the temporary file and removes it, with those that killed processes have left. A
/// device or a pipe is refused, too: the rename would replace it.
/// @throws std::runtime_error naming the file and the cause.
void RequireWritable(const std::filesystem::path& file);

/// Makes a folder with those that it is in; one that is there stays as it is. Thread-safe.
/// @throws std::runtime_error naming the folder and the cause.
void MakeFolder(const std::filesystem::path& folder);

/// Removes the temporary files that killed processes have left in a folder, of all files whose
/// names end so: on a full disk they take the room of what replaces them. Thread-safe.
/// @param extension ".checkpoint"
void RemoveLeftovers(const std::filesystem::path& folder, const std::string& extension);

}  // namespace plumb
