#include "common/program_version.h"

#include <fmt/format.h>

#include "common/version.h"

namespace plumb {

std::string ProgramVersion() { return fmt::format("{} ({})", kVersion, kGitDescription); }

}  // namespace plumb
