#pragma once

#include <fstream>
#include <string>
#include <string_view>

#include "tests/temporary_folder.h"

namespace plumb {

/// A file that is gone with this object.
class TemporaryFile {
 public:
  explicit TemporaryFile(std::string_view contents, const std::string& suffix = "")
      : path_(folder_ / ("file" + suffix)) {
    Write(contents);
  }

  void Write(std::string_view contents) const {
    std::ofstream(path_, std::ios::binary)
        .write(contents.data(), static_cast<std::streamsize>(contents.size()));
  }
  const std::string& path() const { return path_; }

 private:
  TemporaryFolder folder_;
  std::string path_;
};

}  // namespace plumb
