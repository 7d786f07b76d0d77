#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace plumb {

/// A file that is gone with this object.
class TemporaryFile {
 public:
  explicit TemporaryFile(std::string_view contents, const std::string& suffix = "")
      : path_((std::filesystem::temp_directory_path() /
               ("plumbline_log_test_" + std::to_string(getpid()) + suffix))
                  .string()) {
    Write(contents);
  }
  ~TemporaryFile() { std::filesystem::remove(path_); }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;

  void Write(std::string_view contents) const {
    std::ofstream(path_, std::ios::binary)
        .write(contents.data(), static_cast<std::streamsize>(contents.size()));
  }
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace plumb
