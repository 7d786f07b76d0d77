#pragma once

#include <string>

#include "common/config.h"

namespace plumb {

struct JointDescription;
struct MotorDescription;

/// The ranges that the codes of a motor of protocol "mit" stand for, see drivers/protocols/mit.h.
/// All > 0, at the output shaft.
struct MitRanges {
  double position = 12.5;  ///< [rad] positions are in [-position, position]
  double velocity = 0;     ///< [rad/s] likewise
  double torque = 0;       ///< [Nm] likewise
  double kp = 500;         ///< [Nm/rad] in [0, kp]
  double kd = 5;           ///< [Nm s/rad] in [0, kd]
};

/// Settings of a motor of protocol "mit" besides its node.
struct MitDescription {
  int master = 0;  ///< CAN id of the replies
  MitRanges ranges;
  std::string source;  ///< of the ranges: a wrong one scales every value unnoticed
};

/// Reads the table [joint.mit] of a motor of this protocol, whose other keys have been read.
/// Thread-safe. @throws ConfigError
void ReadMit(Config& joint, MotorDescription& motor);

/// Every effort and velocity within the joint's limits must have a code.
/// Thread-safe. @throws ConfigError
void CheckMit(const Config& config, const JointDescription& joint);

}  // namespace plumb
