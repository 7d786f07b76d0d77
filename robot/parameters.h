#pragma once

#include <vector>

#include "common/config.h"
#include "robot/description.h"

namespace plumb {

/// The [[parameter]] tables: those to be inferred, and those with frozen = true. What their names
/// mean is known to the simulator only. @throws ConfigError
void ReadParameters(Config& root, std::vector<ParameterDescription>& parameters,
                    std::vector<FrozenParameter>& frozen);

}  // namespace plumb
