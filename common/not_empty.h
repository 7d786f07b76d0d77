#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace plumb {

/// Of an option whose absence means something: "" is what a shell makes of a variable that is not
/// set. Thread-safe.
inline CLI::Validator NotEmpty() {
  return {[](const std::string& text) { return std::string(text.empty() ? "is empty" : ""); }, ""};
}

}  // namespace plumb
