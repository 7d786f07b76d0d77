#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace plumb {

/// JSON with a field a line, and a line for each row of what has rows: a file that people and diff
/// can read. Numbers read back to the same bits; those that are not finite are null, and bytes that
/// are not UTF-8 are replaced. Thread-safe.
std::string JsonLines(const nlohmann::ordered_json& json);

}  // namespace plumb
