#include "experiments/provenance.h"

#include <fmt/format.h>

#include "common/hash.h"
#include "common/program_version.h"

namespace plumb {

std::string Provenance(const std::vector<RobotDescription>& robots) {
  if (robots.empty()) return ProgramVersion();
  uint64_t hash = kEmptyHash;
  for (const RobotDescription& robot : robots)
    hash = Hash(&robot.fingerprint, sizeof robot.fingerprint, hash);
  return fmt::format("robots {:016x}, {}", hash, ProgramVersion());
}

}  // namespace plumb
