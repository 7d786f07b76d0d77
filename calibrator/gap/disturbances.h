#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "calibrator/motion/transitions.h"
#include "sim/model.h"

namespace plumb {

/// Roll-outs that say nothing of contact: what each contact may have done to the robot in a step,
/// a displacement and a change of velocity along M^-1 J' A^-1 (StepContacts::Contact::response),
/// is a disturbance of that step, as large as the errors of such contacts are (root mean square,
/// per direction, of points of the ground and of stops) and, added in squares, its own. What a
/// contact cannot do still informs: with its two points on the ground, a foot leaves three of the
/// hopper's six directions. Where a model is wrong in contact alone, parameters can so be learnt
/// from all of the motion, and nothing is assumed of the contact's force (cf. Mistry, Buchli,
/// Schaal, ICRA 2010, who control floating bases in the directions that contacts leave).
///
/// Steps whose end was not observed whole, or that cannot be simulated, are left out. Thread-safe.
/// @param physical parameters, by which directions and errors are those of the model's simulator.
/// @throws std::invalid_argument as CollectErrors.
std::vector<Rollout> DisturbedByContacts(const std::shared_ptr<const Model>& model,
                                         const Eigen::VectorXd& physical,
                                         std::span<const Rollout> rollouts);

}  // namespace plumb
