#pragma once

#include <string>

#include "robot/description.h"

namespace plumb {

/// A robot as MuJoCo's XML has it (MJCF, of MuJoCo 2.2 and later). Bodies and joints have the names
/// of the URDF's links and joints: hinges, slides and balls. Masses, inertias, armature, damping,
/// Coulomb friction, springs and limits of the description; a ball has none of the last five.
/// Each driven joint has a motor of its own name, whose control is the effort commanded [Nm or N],
/// within the joint's limit; where the drive runs a loop of its own, the actuator does
/// (DriveEffort), and the limit is that of what it makes. Spheres, boxes and capsules of its
/// collision shapes touch the ground with its friction, and each other where
/// ContactPairs has them; of a mesh the corners of its hull touch the ground. How contacts and
/// limits give way is MuJoCo's own matter, as gym's Hopper sets it: solref 0.02 1 (see
/// ContactTime), solimp 0.8 0.8 0.01 and a margin of 1 mm for contacts, MuJoCo's defaults for
/// limits. Runge-Kutta
/// of fourth order, 2 ms.
///
/// What else the description says of joints (RequireKnownJoints), and contact's stiffness, damping
/// and slip speed, is not in it. A link without mass that carries one joint is no body of its own:
/// that joint is one more of the next link's.
/// @param robot with known parameters (Model::Describe). Thread-safe.
/// @throws std::invalid_argument if such a link is to touch the ground or others.
std::string Mjcf(const RobotDescription& robot);

/// [s] of a contact's softness, the first number of solref: gym's over the square root of
/// UnmodelledGround::stiffness_factor. The damping stays critical.
double ContactTime(const RobotDescription& robot);

}  // namespace plumb
