#pragma once

#include <memory>

#include "robot/description.h"
#include "sim/virtual/physics_backend.h"

namespace plumb {

/// ODE (Open Dynamics Engine) as what moves a robot: rigid bodies in maximal coordinates, held
/// together by constraints that are solved for in every step, together with contacts, stops and
/// friction, as a linear complementarity problem (dWorldStep: Dantzig's algorithm). Drift out of
/// the joints is taken back as ODE does by default. A link without mass gets kOdeLightest of the
/// robot's.
///
/// Armature, damping and springs are one row a joint: a motor so soft that it yields as they do at
/// the end of the step. Coulomb friction is a motor that wants to stand still and has no more force
/// than that. Spheres, ends of capsules and corners of boxes touch the ground; the normal force is
/// that of kOdeGround, never one that pulls, and friction is within a pyramid along x and y. Stops
/// push back by kOdeStop.
///
/// Goes from event to event in equal steps of ODE's semi-implicit Euler, kOdeStep at most. The same
/// calls give the same bits: nothing is drawn at random, and no thread is used but the caller's.
/// @throws std::invalid_argument if ODE is not part of this build, or cannot be told what the robot
/// is.
std::unique_ptr<PhysicsBackend> MakeOdeBackend(const RobotDescription& robot);

/// Whether ODE is part of this build. Functions here are thread-safe.
bool HasOde();

/// What pushes back in proportion to depth and to the speed with which that grows.
struct Cushion {
  double stiffness;  ///< [N/m] or [Nm/rad]
  double damping;    ///< [N s/m] or [Nm s/rad]
};
/// At each point; stiffness x stiffness_factor, and damping x its square root.
inline constexpr Cushion kOdeGround{2e5, 2e3};
inline constexpr Cushion kOdeStop{2e4, 300};
inline constexpr double kOdeStep = 2.5e-4;    ///< [s]
inline constexpr double kOdeLightest = 1e-6;  ///< mass of a link that has none, as a share

}  // namespace plumb
