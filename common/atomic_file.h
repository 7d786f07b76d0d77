#pragma once

#include <filesystem>
#include <string_view>

namespace plumb {

/// Writes a file so that a reader sees the old or the new content, never a part, whenever the process or the
/// machine dies: temporary file beside it, fsync, rename. @throws std::runtime_error naming the file and the cause.
void WriteAtomically(const std::filesystem::path& file, std::string_view content);

}  // namespace plumb
