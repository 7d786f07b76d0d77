#pragma once

#include <cstdint>
#include <memory>

#include "robot/description.h"
#include "robot/residual.h"

namespace plumb {

/// Extended random force injection (Campanaro et al., arXiv 2209.12878), in place of a residual
/// that is learnt: in every step the driven joints are pushed at random, and throughout an episode
/// by an offset, each by a normal torque of `share` of the joint's effort limit. Half of the
/// episodes have neither (ParameterDistribution::Draw). Thread-safe.
std::shared_ptr<const Residual> RandomForces(const RobotDescription& robot, double share,
                                             uint64_t seed);

}  // namespace plumb
