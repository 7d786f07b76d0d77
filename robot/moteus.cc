#include "robot/moteus.h"

#include <fmt/format.h>

#include "robot/joints.h"

namespace plumb {

void ReadMoteus(Config& joint, MotorDescription& motor) {
  Config config = joint.Table("moteus");
  MoteusDescription moteus;
  moteus.torque = config.Number("torque", {1e-3, 1e6});
  moteus.watchdog = config.Number("watchdog", {0.02, 1}, moteus.watchdog);
  config.Finish();
  motor.moteus = moteus;
  // The firmware takes no other numbers (fw/moteus.cc), and 127 is everybody.
  if (motor.node < 1 || motor.node > 126)
    joint.Fail("node", fmt::format("= {}: a moteus has an id from 1 to 126", motor.node));
}

void CheckMoteus(const Config& config, const JointDescription& joint) {
  const MoteusDescription& moteus = *joint.motor.moteus;
  const double torque = joint.effort_limit / joint.motor.gear;
  if (torque > moteus.torque) {
    config.Fail("moteus", fmt::format("has torques up to {} Nm, but the joint's limit is {} Nm at "
                                      "the motor",
                                      moteus.torque, torque));
  }
}

}  // namespace plumb
