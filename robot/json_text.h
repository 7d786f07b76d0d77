#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string_view>

namespace plumb {

/// Parses the text of a JSON file. Thread-safe.
/// @throws std::runtime_error "parse error at line 1, column 2: ..." if it is none, and if it has a
/// number of more than 100 characters, or nests deeper than 100: what follows would take minutes,
/// or the stack.
nlohmann::json ParseJson(std::string_view text);

}  // namespace plumb
