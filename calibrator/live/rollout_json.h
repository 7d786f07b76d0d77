#pragma once

#include <nlohmann/json.hpp>

#include "calibrator/motion/transitions.h"
#include "robot/description.h"

namespace plumb {

// A roll-out as a checkpoint has it: all of its transitions as they are recorded. Thread-safe.

nlohmann::json ToJson(const Rollout& rollout);
/// @throws std::runtime_error or nlohmann::json::exception if it is none.
Rollout RolloutFrom(const nlohmann::json& j);

/// @throws std::runtime_error if the roll-out has sizes or numbers that the robot's cannot have.
void RequireTransitions(const Rollout& rollout, const RobotDescription& robot);

}  // namespace plumb
