#pragma once

#include <Eigen/Core>
#include <string>

#include "robot/description.h"

namespace plumb {

/// The robot with these values of its parameters as MuJoCo's XML (see Mjcf), and a comment at its
/// top with the values and their standard deviations, and with what MuJoCo's XML has no place for:
/// delays, sensor errors, the limits of motors at speed, how contacts and stops give way.
/// @param mean,sd of robot.parameters, physical units.
/// @param residual whether the robot does what these cannot explain, and a residual was learnt,
/// which is not in the file: the comment then says so.
/// @throws std::invalid_argument naming the parameter if its value is not physical. Thread-safe.
std::string IdentifiedMjcf(const RobotDescription& robot, const Eigen::VectorXd& mean,
                           const Eigen::VectorXd& sd, bool residual = false);

}  // namespace plumb
