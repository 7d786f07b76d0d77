#pragma once

#include "robot/description.h"

namespace plumb {

/// The robot with robot.virtual_robot.sprung_masses as what they are: a link each, as good as a
/// point, on a slide with a spring. They come after the robot's own links and joints. Thread-safe.
RobotDescription WithSprungMasses(RobotDescription robot);

}  // namespace plumb
