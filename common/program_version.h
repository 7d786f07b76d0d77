#pragma once

#include <string>

namespace plumb {

/// "1.0.0 (3f2a9c1, clean)": the same for programs that were built from the same sources.
/// Thread-safe.
std::string ProgramVersion();

}  // namespace plumb
