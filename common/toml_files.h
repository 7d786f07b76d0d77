#pragma once

#define TOML_HEADER_ONLY 1
#include <toml++/toml.h>

#include <string>
#include <vector>

// TOML files as Config reads them. Only config.cc includes this: toml++ takes seconds to compile.
// Thread-safe but for the files.
namespace plumb {

/// "file:line:column: " of a value; that of its own file, if it was merged in from another one.
std::string TomlPlace(const std::string& file, const toml::source_region& source);

/// @param name stands for the file. @throws ConfigError.
toml::table ParseToml(const std::string& text, const std::string& name);

/// Reads a file and those that it extends, merged as Config::Load says.
/// @param files those that were read are appended to it, this one first.
/// @throws ConfigError if one cannot be opened or parsed, or they extend each other.
toml::table LoadTomlChain(const std::string& file, std::vector<std::string>& files);

}  // namespace plumb
