#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace plumb {

/// The built page: the files of one folder. Not thread-safe.
class PageFolder {
 public:
  struct File {
    std::string type;  ///< "text/html; charset=utf-8"
    std::string content;
    bool gzipped;
  };

  explicit PageFolder(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// @param path of a URL, without its query: "/", which is index.html, or "/page.js".
  /// @param gzip whether it may be the compressed file beside it, page.js.gz, if there is one.
  /// @return none if there is no such file. Names with anything in them but letters, digits, '.',
  /// '-' and '_', and files behind links, are none of ours. Without a built page "/" says how to
  /// build it.
  std::optional<File> Find(std::string_view path, bool gzip = false) const;

 private:
  const std::filesystem::path folder_;
};

/// Where the page is: beside the programs as they are installed, or as they are built.
std::filesystem::path DefaultPageFolder();

}  // namespace plumb
