#pragma once

#include <string>

#include "common/config.h"

namespace plumb {

struct JointDescription;
struct MotorDescription;

/// Settings of a motor of protocol "rmd" besides its node, see drivers/protocols/rmd.h.
struct RmdDescription {
  /// [Nm/A] > 0 at the output shaft, of the torque current, which is what the motor obeys
  double torque_constant = 0;
  double current = 0;     ///< [A] > 0 the greatest torque current it may be asked for
  double watchdog = 0.1;  ///< [s] > 0 without a frame after which it shall switch itself off
  std::string source;     ///< of constant and current: a wrong one scales every effort unnoticed
};

/// Reads the table [joint.rmd] of a motor of this protocol, whose other keys have been read.
/// Thread-safe. @throws ConfigError
void ReadRmd(Config& joint, MotorDescription& motor);

/// The current must do for every effort within the joint's limit. Thread-safe. @throws ConfigError
void CheckRmd(const Config& config, const JointDescription& joint);

}  // namespace plumb
