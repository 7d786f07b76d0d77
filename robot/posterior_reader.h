#pragma once

#include <filesystem>

#include "robot/description.h"
#include "robot/parameter_distribution.h"

namespace plumb {

/// The mixture of a posterior.json (docs/posterior.md), with the residual and the starts that are
/// in it, for this robot: physics (see PhysicsFingerprint) and parameters must be those that the
/// posterior was made with; priors and settings of tasks or training may have changed since.
/// Whether the residual's inputs are the robot's is not looked at: RequireResidualOf. Thread-safe.
/// @throws std::runtime_error "file: field: what is wrong" for anything missing, of the wrong type
/// or size, not finite, another robot's or another version's, weights that do not sum to one, a
/// covariance that is not positive definite, or a scale that is not positive.
ParameterDistribution ReadPosterior(const std::filesystem::path& file,
                                    const RobotDescription& robot);

}  // namespace plumb
