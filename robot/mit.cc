#include "robot/mit.h"

#include <fmt/format.h>

#include "robot/joints.h"

namespace plumb {

void ReadMit(Config& joint, MotorDescription& motor) {
  Config config = joint.Table("mit");
  MitDescription mit;
  mit.master = config.Integer("master", {0, 0x7FF}, 0);
  mit.ranges.position = config.Number("position", {1e-3, 1e6}, mit.ranges.position);
  mit.ranges.velocity = config.Number("velocity", {1e-3, 1e6});
  mit.ranges.torque = config.Number("torque", {1e-3, 1e6});
  mit.ranges.kp = config.Number("kp", {1e-3, 1e6}, mit.ranges.kp);
  mit.ranges.kd = config.Number("kd", {1e-3, 1e6}, mit.ranges.kd);
  mit.source = config.String("source");
  if (mit.source.empty()) config.Fail("source", "is empty: say where the ranges are from");
  config.Finish();
  motor.mit = mit;
  if (mit.master == motor.node) {
    joint.Fail("node", fmt::format("= {} is also the id of its replies, mit.master", motor.node));
  }
}

void CheckMit(const Config& config, const JointDescription& joint) {
  const MitRanges& ranges = joint.motor.mit->ranges;
  const double torque = joint.effort_limit / joint.motor.gear,
               velocity = joint.velocity_limit * joint.motor.gear;
  if (torque > ranges.torque) {
    config.Fail("mit",
                fmt::format("has torques up to {} Nm, but the joint's limit is {} Nm at the motor",
                            ranges.torque, torque));
  }
  if (velocity > ranges.velocity) {
    config.Fail(
        "mit",
        fmt::format("has velocities up to {} rad/s, but the joint's limit is {} rad/s at the motor",
                    ranges.velocity, velocity));
  }
}

}  // namespace plumb
