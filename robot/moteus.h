#pragma once

#include "common/config.h"

namespace plumb {

struct JointDescription;
struct MotorDescription;

/// Settings of a motor of protocol "moteus" besides its node, see drivers/protocols/moteus.h.
struct MoteusDescription {
  double torque = 0;      ///< [Nm] > 0 at the output shaft: the greatest it may be asked for
  double watchdog = 0.1;  ///< [s] > 0 for which it obeys a command without another
};

/// Reads the table [joint.moteus] of a motor of this protocol, whose other keys have been read.
/// Thread-safe. @throws ConfigError
void ReadMoteus(Config& joint, MotorDescription& motor);

/// The joint's effort limit must be within the motor's. Thread-safe. @throws ConfigError
void CheckMoteus(const Config& config, const JointDescription& joint);

}  // namespace plumb
