#pragma once

#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace plumb {

/// Ends a command's --help with commands that a reader can type: `tests/cli/help_test.py` wants one
/// of each command, and knows what they need. Thread-safe for different apps.
void AddExamples(CLI::App& app, const std::vector<std::string>& commands);

}  // namespace plumb
