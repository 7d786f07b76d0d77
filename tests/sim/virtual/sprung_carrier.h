#pragma once

#include <cmath>
#include <numbers>

#include "tests/sim/virtual/ball.h"

namespace plumb {

/// The ball as the carrier of a mass that swings upright in it, on a spring.
struct SprungCarrier {
  static constexpr double kCarrier = 2, kMass = 0.5, kBoth = kCarrier + kMass;  // [kg]
  static constexpr double kFrequency = 5, kDampingRatio = 0.1;

  static RobotDescription Robot(VirtualRobotSettings::Engine engine) {
    RobotDescription ball = Ball();
    ball.virtual_robot.engine = engine;
    ball.virtual_robot.sprung_masses = {{.name = "load",
                                         .link = 2,
                                         .mass = kMass,
                                         .frequency = kFrequency,
                                         .damping_ratio = kDampingRatio,
                                         .axis = Eigen::Vector3d::UnitZ(),
                                         .centre = {0.3, 0, 0.2},
                                         .travel = 0.5}};
    return ball;
  }

  /// How far the carrier has risen t seconds after a force began to lift both from rest, without
  /// gravity. Two masses, one spring: the mass relative to its carrier by the reduced mass, both
  /// together by the force.
  static double Rise(double force, double t) {
    const double ratio = 1 + kMass / kCarrier, own = 2 * std::numbers::pi * kFrequency;
    const double rate = own * std::sqrt(ratio), zeta = kDampingRatio * std::sqrt(ratio);
    const double damped = rate * std::sqrt(1 - zeta * zeta);
    const double rest = -force / kCarrier / (rate * rate);
    const double swing =
        rest * (1 - std::exp(-zeta * rate * t) *
                        (std::cos(damped * t) + zeta * rate / damped * std::sin(damped * t)));
    return force * t * t / 2 / kBoth - swing * kMass / kBoth;
  }
};

}  // namespace plumb
