#pragma once

#include <span>
#include <string>
#include <vector>

#include "calibrator/motion/transitions.h"
#include "robot/description.h"

namespace plumb {

/// Takes readings that are the same at all beginnings and ends for what they may be, no readings:
/// the ends of a joint's positions, and of its velocities, become NaN where no standard deviation
/// says how good they are; of velocities of a joint that moves the beginnings are guesses, see
/// ForgetVelocities. Of what never changed the noise cannot be told, and would be estimated as next
/// to nothing. Leaves all as it is where nothing ever changed. Thread-safe.
/// @return "q/knee", "v/knee" and so on: those that were forgotten.
std::vector<std::string> ForgetStill(const RobotDescription& robot, std::vector<Rollout>* rollouts);

/// What that means: a sentence.
std::string StillWarning(std::span<const std::string> forgotten);

}  // namespace plumb
