#pragma once

#include <string>

#include "robot/description.h"

namespace plumb {

/// A robot as MuJoCo's XML has it: hinges, slides and balls, each named by MjcfJoint; masses,
/// inertias, armature, damping, Coulomb friction, springs and limits of the description; a ball has
/// none of these. Spheres, boxes and capsules of its collision shapes touch the ground with its
/// friction, and not each other. How contacts and limits give way is MuJoCo's own matter, as gym's
/// Hopper sets it: solref 0.02 1 (see ContactTime), solimp 0.8 0.8 0.01 and a margin of 1 mm for
/// contacts, MuJoCo's defaults for limits. Runge-Kutta of fourth order.
/// @param robot with known parameters. Thread-safe.
/// @throws std::invalid_argument naming what of the robot MuJoCo cannot be told.
std::string Mjcf(const RobotDescription& robot);

/// Its name of a joint.
std::string MjcfJoint(size_t index);

/// [s] of a contact's softness, the first number of solref: gym's over the square root of
/// UnmodelledGround::stiffness_factor. The damping stays critical.
double ContactTime(const RobotDescription& robot);

}  // namespace plumb
