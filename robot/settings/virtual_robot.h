#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "common/config.h"

namespace plumb {

struct RobotDescription;

/// A parameter that the virtual robot draws from a uniform distribution, physical units.
struct HiddenParameter {
  std::string name;  ///< one of the parameters
  double lower, upper;
};

/// Effects in a virtual robot's joint with a motor besides its JointDynamics: none of the models
/// knows of them.
struct UnmodelledJoint {
  int joint = -1;       ///< index into joints
  double friction = 0;  ///< [Nm] or [N] >= 0 of Coulomb friction
  double delay = 0;     ///< [s] 0 to JointDynamics::kLongestDelay, of efforts
  double backlash = 0;  ///< [rad] or [m] >= 0 between the two ends of the gear's play
  /// [kg m^2] or [kg], seen at the joint, of what is before the play; > 0 if there is any. The
  /// joint's armature is part of it.
  double rotor = 0;
};

/// What the ground is and no model knows. Only of a robot that touches the ground.
struct UnmodelledGround {
  double stiffness_factor = 1;          ///< > 0, on what the engine's ground has
  std::optional<double> friction = {};  ///< >= 0, in place of the robot's own contact friction
  /// [rad] by which it rises towards +x. Positions and orientations count from the ground as if it
  /// were level, so that it is gravity that leans.
  double slope = 0;

  /// Where gravity pulls: a unit vector.
  Eigen::Vector3d Down() const;
};

/// A mass on a spring and a damper that a link carries along a line.
struct SprungMass {
  std::string name;
  int link;                ///< index into links, not 0
  double mass;             ///< [kg] > 0, besides the link's own
  double frequency;        ///< [Hz] > 0 of its swing while the link is held
  double damping_ratio;    ///< >= 0, likewise; 1 is critical
  Eigen::Vector3d axis;    ///< of its line in the link's frame, a unit vector
  Eigen::Vector3d centre;  ///< [m] in the link's frame, where it rests in the robot's zero pose
  double travel;           ///< [m] > 0 to its stops, either way; infinity: it has none
};

/// [virtual_robot].
struct VirtualRobotSettings {
  /// The physics that integrates its motion, see VirtualPlant.
  enum class Engine { kAuto, kMujoco, kSimbody, kOde };

  double watchdog;   ///< [s]
  double heartbeat;  ///< [s]
  int encoder_bits;  ///< per motor turn
  std::vector<HiddenParameter> hidden = {};
  Engine engine = Engine::kAuto;
  std::string engine_source = {};  ///< "file:line:column: " of the engine, for messages
  std::vector<UnmodelledJoint> joints = {};
  UnmodelledGround ground = {};
  std::vector<SprungMass> sprung_masses = {};
};

/// @param robot with links, joints, simulation and parameters. Thread-safe. @throws ConfigError
VirtualRobotSettings ReadVirtualRobot(Config config, const RobotDescription& robot);

}  // namespace plumb
