#pragma once

#include <string>

#include "robot/description.h"

namespace plumb {

/// Two joints on ODrives, one of them behind a gear and turned round, and a slide on the boom that
/// an encoder measures; short times, so that much happens in few cycles.
inline RobotDescription Leg() {
  RobotDescription robot{};
  robot.links.resize(4);
  for (size_t i = 0; i < 3; ++i) {
    JointDescription joint;
    joint.name = std::string("joint") + std::to_string(i);
    joint.parent = static_cast<int>(i);
    joint.child = static_cast<int>(i) + 1;
    joint.lower = -1.5;
    joint.upper = 1.5;
    joint.effort_limit = 3;
    joint.velocity_limit = 20;
    joint.motor = {.protocol = "cansimple",
                   .node = static_cast<int>(i) + 1,
                   .gear = i == 0 ? 1. : 6.,
                   .sign = i == 0 ? 1 : -1,
                   .offset = 0.1};
    robot.joints.push_back(joint);
  }
  JointDescription& slide = robot.joints[2];
  slide.type = JointDescription::Type::kPrismatic;
  slide.passive = true;
  slide.motor = {};
  SensorDescription boom;
  boom.name = "boom";
  boom.protocol = "cia406";
  boom.period = 0.005;
  boom.joint = 2;
  boom.node = 1;
  boom.counts = boom.range = 65536;
  boom.max_speed = 10;
  robot.sensors.push_back(boom);
  robot.driver = {.cycle = 0.005,
                  .measurement = 0.005,
                  .expiry = 0.02,
                  .disarm_after = 0.06,
                  .stale_after = 0.02,
                  .heartbeat_timeout = 0.1,
                  .start_guard = 0.05};
  return robot;
}

}  // namespace plumb
