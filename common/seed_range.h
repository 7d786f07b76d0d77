#pragma once

#include <CLI/CLI.hpp>

namespace plumb {

/// Of what --seed takes: else -1 would be the greatest of them. Thread-safe.
inline CLI::Range SeedRange() { return {0.0, 18446744073709551615.0}; }

}  // namespace plumb
