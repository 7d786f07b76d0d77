#pragma once

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
  /// [kg m^2] or [kg], seen at the joint, of what is before the play; > 0 if there is any
  double rotor = 0;
};

/// [virtual_robot].
struct VirtualRobotSettings {
  /// The physics that integrates its motion, see VirtualPlant.
  enum class Engine { kAuto, kMujoco };

  double watchdog;   ///< [s]
  double heartbeat;  ///< [s]
  int encoder_bits;  ///< per motor turn
  std::vector<HiddenParameter> hidden = {};
  Engine engine = Engine::kAuto;
  std::string engine_source = {};  ///< "file:line:column: " of the engine, for messages
  std::vector<UnmodelledJoint> joints = {};
};

/// @param robot with joints and parameters. Thread-safe. @throws ConfigError
VirtualRobotSettings ReadVirtualRobot(Config config, const RobotDescription& robot);

}  // namespace plumb
