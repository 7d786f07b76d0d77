#include "dashboard/page.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>
#include <sstream>
#include <utility>

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr uintmax_t kMaxSize = 16 << 20;  // [bytes]
constexpr std::array<std::pair<std::string_view, std::string_view>, 7> kTypes{{
    {".html", "text/html; charset=utf-8"},
    {".js", "text/javascript; charset=utf-8"},
    {".css", "text/css; charset=utf-8"},
    {".svg", "image/svg+xml"},
    {".png", "image/png"},
    {".woff2", "font/woff2"},
    {".txt", "text/plain; charset=utf-8"},
}};

bool IsPlain(std::string_view name) {
  return !name.empty() && name.front() != '.' && std::ranges::all_of(name, [](unsigned char c) {
    return std::isalnum(c) || c == '.' || c == '-' || c == '_';
  });
}

std::optional<std::string> Read(const fs::path& file) {
  std::error_code error;
  if (fs::symlink_status(file, error).type() != fs::file_type::regular ||
      fs::file_size(file, error) > kMaxSize)
    return std::nullopt;
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream content;
  content << stream.rdbuf();
  return stream ? std::optional(content.str()) : std::nullopt;
}

}  // namespace

std::optional<PageFolder::File> PageFolder::Find(std::string_view path, bool gzip) const {
  const bool first = path == "/";
  const std::string_view name =
      first ? "index.html" : path.substr(std::min<size_t>(1, path.size()));
  if (!path.starts_with('/') || !IsPlain(name)) return std::nullopt;
  const fs::path file = folder_ / name;
  const auto type =
      std::ranges::find(kTypes, file.extension().string(), &decltype(kTypes)::value_type::first);
  if (type != kTypes.end()) {
    for (const bool gzipped : {true, false}) {
      if (gzipped && !gzip) continue;
      if (auto content = Read(gzipped ? fs::path(file) += ".gz" : file))
        return File{std::string(type->second), std::move(*content), gzipped};
    }
  }
  if (!first) return std::nullopt;
  return File{"text/plain; charset=utf-8",
              fmt::format("The page has not been built: there is no {}.\n"
                          "`scripts/setup --page` installs what that takes, `ninja -C build "
                          "dashboard_page` builds it.\n"
                          "Foxglove and Lichtblick can connect to this address without it.\n",
                          file.string()),
              false};
}

fs::path DefaultPageFolder() {
  std::error_code error;
  const fs::path programs = fs::read_symlink("/proc/self/exe", error).parent_path();
  const fs::path installed = programs.parent_path() / "share/plumbline/dashboard";
  return fs::exists(installed, error) ? installed : programs.parent_path() / "dashboard/page";
}

}  // namespace plumb
