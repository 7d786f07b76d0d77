#pragma once

#include <Eigen/Core>
#include <vector>

#include "common/random.h"

namespace plumb {

// A robot that is not one simulator but two: one joint under gravity with an arm, J = 0.05 kg m^2,
// and a payload at 0.5 m that is sometimes light and sometimes heavy: 0.8 exp(xi / 2) kg, xi = -1
// in four transitions of ten and +1 in six. A transition is (s, a, s'): any angle, a velocity up to
// 2 rad/s, 3 N m either way for 50 ms, states read with noise. Given (s, a), s' is bimodal. States
// are the angle from upright down [rad] and the velocity [rad/s]. Thread-safe.

inline constexpr double kLightPayload = -1, kHeavyPayload = 1;  ///< xi
inline constexpr double kHeavyShare = 0.6;                      ///< of the transitions
/// sd of a next state that was read [rad, rad/s]
inline const Eigen::Vector2d kPayloadNoise(0.0005, 0.015);

struct PayloadTransition {
  Eigen::Vector2d state, next;
  double effort;  ///< [N m]
};

/// The state after 50 ms, of the simulator xi.
Eigen::Vector2d PayloadStep(Eigen::Vector2d state, double effort, double xi);

/// A next state as it is read.
Eigen::Vector2d ReadPayload(const Eigen::Vector2d& state, Random& random);

/// What the robot does.
std::vector<PayloadTransition> RecordPayloads(int count, Random& random);

}  // namespace plumb
