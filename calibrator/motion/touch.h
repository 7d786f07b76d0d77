#pragma once

#include <Eigen/Core>

#include "calibrator/motion/transitions.h"
#include "robot/description.h"
#include "sim/touch.h"

namespace plumb {

/// The ground and the stops that a robot touches in a state: TouchFinder.
/// @param robot with known parameters (Model::Describe), as lengths decide how far down it reaches.
/// @param q as in RobotDescription. @throws std::invalid_argument if q has the wrong size.
/// Thread-safe.
Touch FindTouch(const RobotDescription& robot, const Eigen::Ref<const Eigen::VectorXd>& q);

/// Of a transition: at its beginning or its end. Where the end was not observed the beginning has
/// to do.
Touch FindTouch(const RobotDescription& robot, const Transition& transition);

}  // namespace plumb
