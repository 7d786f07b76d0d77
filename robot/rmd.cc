#include "robot/rmd.h"

#include <fmt/format.h>

#include "robot/joints.h"

namespace plumb {

void ReadRmd(Config& joint, MotorDescription& motor) {
  Config config = joint.Table("rmd");
  RmdDescription rmd;
  rmd.torque_constant = config.Number("torque_constant", {1e-3, 1e3});
  rmd.current = config.Number("current", {0.01, 327.67});  // what its commands can say
  rmd.watchdog = config.Number("watchdog", {0.02, 1}, rmd.watchdog);
  rmd.source = config.String("source");
  if (rmd.source.empty()) config.Fail("source", "is empty: say where the numbers are from");
  config.Finish();
  motor.rmd = rmd;
}

void CheckRmd(const Config& config, const JointDescription& joint) {
  const RmdDescription& rmd = *joint.motor.rmd;
  const double torque = joint.effort_limit / joint.motor.gear,
               most = rmd.torque_constant * rmd.current;
  if (torque > most) {
    config.Fail("rmd", fmt::format("has torques up to {} Nm, but the joint's limit is {} Nm at the "
                                   "motor",
                                   most, torque));
  }
}

}  // namespace plumb
