#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "common/config.h"
#include "robot/buses.h"
#include "robot/mit.h"
#include "robot/moteus.h"
#include "robot/parameter_kinds.h"
#include "robot/rmd.h"
#include "robot/settings/estimator.h"
#include "robot/urdf/urdf.h"

namespace plumb {

/// Address, gear and zero of a joint's motor.
struct MotorDescription {
  std::string protocol;  ///< file name in drivers/protocols/, e.g. "cansimple"
  int node = 0;          ///< CAN node id of the protocol, on its bus no other motor's
  /// [rad/rad], of a prismatic joint [rad/m]: motor angle per displacement of the joint, > 0
  double gear = 1;
  int sign = 1;                            ///< +1 or -1
  double offset = 0;                       ///< [rad] or [m] joint position at motor position 0
  size_t bus = 0;                          ///< index into the robot's buses
  std::optional<MitDescription> mit = {};  ///< of protocol "mit" and no other
  std::optional<RmdDescription> rmd = {};  ///< of protocol "rmd" and no other
  std::optional<MoteusDescription> moteus = {};  ///< of protocol "moteus" and no other
};

/// How the driver keeps a joint with a motor within its limits, and how the joint stops.
struct JointLimitSettings {
  double position_margin =
      0;  ///< [rad] or [m] >= 0 before a position limit, in which efforts towards it fade
  /// [Nm/s] or [N/s] > 0, away from zero
  double effort_rate = std::numeric_limits<double>::infinity();
  /// [Nm s/rad] or [N s/m] >= 0 of a stop by damping, see DriverSettings::stop
  double damping = 0;
};

/// A moving joint: the URDF's, and what robot.toml says of it.
struct JointDescription : JointGeometry {
  bool passive = false;    ///< has no motor
  MotorDescription motor;  ///< of a joint that is not passive
  JointDynamics dynamics;
  JointLimitSettings limits;  ///< of a joint that is not passive
  NoiseDescription noise = {};

  bool IsOf(JointGroup group) const;
};

/// Whether the motor's protocol needs a bus that carries CAN FD. Thread-safe.
bool NeedsFd(const MotorDescription& motor);

/// Whether that is a joint that does not move, as the URDF or robot.toml has it, by which something
/// hangs on one of the links. Thread-safe.
bool IsFixedJoint(const std::vector<LinkDescription>& links, const std::string& name);

/// The URDF's joints as they are without robot.toml: none passive, no motor known. Thread-safe.
std::vector<JointDescription> JointsOf(const UrdfModel& urdf);

/// The URDF's joints with what the [[joint]] tables say of them: motors and dynamics. Every joint
/// is passive or has a motor, and moves some inertia. Thread-safe. @throws ConfigError
std::vector<JointDescription> ReadJoints(Config& root, const UrdfModel& urdf,
                                         const std::vector<BusDescription>& buses);

}  // namespace plumb
