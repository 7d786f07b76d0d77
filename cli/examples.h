#pragma once

namespace CLI {
class App;
}

namespace plumb {

/// Gives each command of plumb its examples. Thread-safe for different apps.
void AddCommandExamples(CLI::App& plumb);

}  // namespace plumb
