#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "calibrator/live/simopt.h"
#include "calibrator/motion/transitions.h"
#include "robot/description.h"
#include "tests/calibrator/synthetic.h"

namespace plumb {

/// Gravity (m/s^2), mass (kg) and length (m) of the pendulum that the roll-outs are of.
inline const Eigen::Vector3d kTruth(9.3, 0.93, 1.07);
/// The direction of (ln g, ln m, ln l) that changes no motion, known in closed form.
inline const Eigen::Vector3d kNull(1, -2, 1);
/// Powers of (g, m, l) whose products a motion tells.
inline const Eigen::Vector3d kGravityOverLength(1, 0, -1), kMassLengthSquared(0, 1, 2);

/// The logarithm of the product of the true parameters with these powers.
inline double LogTruth(const Eigen::Vector3d& power) {
  return power.dot(kTruth.array().log().matrix());
}

/// The i-th roll-out: 100 steps with little noise.
inline Rollout Synthetic(const RobotDescription& robot, uint32_t i) {
  return SyntheticRollout(robot, kTruth, 100, 1e-4, 0.01, i);
}

/// All updates of the iteration that has begun.
inline CalibrationReport Finish(SimOpt& simopt) {
  for (int update = 0; update < 100; ++update) {
    if (auto report = simopt.Update()) return *report;
  }
  throw std::logic_error("the iteration does not end");
}

/// So many iterations, a roll-out each.
inline void Iterate(SimOpt& simopt, const RobotDescription& robot, int iterations) {
  for (int i = 0; i < iterations; ++i) {
    simopt.Begin({Synthetic(robot, static_cast<uint32_t>(i))});
    Finish(simopt);
  }
}

}  // namespace plumb
