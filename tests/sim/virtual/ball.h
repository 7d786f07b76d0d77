#pragma once

#include "sim/model.h"
#include "tests/sim/robots.h"

namespace plumb {

/// A robot of robots/ with its prior's means.
inline RobotDescription Known(const std::string& name) {
  const Model model(LoadRobot(SourceFile("robots/" + name)));
  return model.Describe(model.parameters().means());
}

/// A ball of 2 kg and 0.1 m that slides along x and z, on a ground with friction 0.5.
inline RobotDescription Ball() {
  RobotDescription ball = Known("hopper");
  ball.links.resize(3);
  ball.links[2] = {.name = "ball", .mass = 2, .inertia = 0.01 * Eigen::Matrix3d::Identity()};
  ball.links[2].collisions.push_back({.type = Shape::Type::kSphere, .size = {0.1, 0, 0}});
  ball.joints.resize(2);
  ball.simulation.contact->friction = 0.5;
  return ball;
}

/// A ground that rises by so much along x [rad].
inline UnmodelledGround Slope(double slope) {
  UnmodelledGround ground;
  ground.slope = slope;
  return ground;
}

}  // namespace plumb
