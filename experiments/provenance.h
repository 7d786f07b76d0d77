#pragma once

#include <string>
#include <vector>

#include "robot/description.h"

namespace plumb {

/// What results depend on beside an experiment's settings, for the first line of their table: the
/// robots' files, as one hash of their fingerprints in this order, and the program's version.
/// "robots 9ae16a3b2f90404f, 1.0.0 (3f2a9c1, clean)"; without robots the version alone.
/// Thread-safe.
std::string Provenance(const std::vector<RobotDescription>& robots);

}  // namespace plumb
