#pragma once

#include <string>

namespace plumb {

/// "0.1.0 (3f2a9c1, clean)": what was built from the same state of the sources has the same.
std::string ProgramVersion();

}  // namespace plumb
