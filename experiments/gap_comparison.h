#pragma once

#include <array>

#include "experiments/calibration_strategy.h"

namespace plumb {

// What plumb-reality-gap compares: robots, and ways of using them. Constants, by keys for the
// command line and the table, and titles for people.

/// A robot that is none of the simulators. Files below robots/: what is there, what is believed,
/// what is believed with contact uncertain, too.
struct RealityGap {
  const char *key, *title;
  const char *truth, *model, *uncertain;
};
inline constexpr std::array<RealityGap, 10> kRealityGaps{
    {{"hopper", "MuJoCo's hopper", "hopper/mujoco.toml", "hopper/robot.toml",
      "hopper/mujoco_fitted.toml"},
     {"stiff", "ground five times stiffer", "hopper/mujoco_stiff.toml", "hopper/robot.toml",
      "hopper/mujoco_fitted.toml"},
     {"slippery", "slippery ground", "hopper/mujoco_slippery.toml", "hopper/robot.toml",
      "hopper/mujoco_fitted.toml"},
     {"slope", "a slope of 3 degrees", "hopper/mujoco_slope.toml", "hopper/robot.toml",
      "hopper/mujoco_fitted.toml"},
     {"simbody", "Simbody's hopper", "hopper/simbody.toml", "hopper/robot.toml",
      "hopper/mujoco_fitted.toml"},
     {"ode", "ODE's hopper", "hopper/ode.toml", "hopper/robot.toml", "hopper/mujoco_fitted.toml"},
     {"worn", "worn hopper", "hopper/worn.toml", "hopper/robot.toml", "hopper/mujoco_fitted.toml"},
     {"right", "the model itself", "hopper/robot.toml", "hopper/robot.toml",
      "hopper/mujoco_fitted.toml"},
     {"pendulum", "worn pendulum", "pendulum/worn.toml", "pendulum/robot.toml",
      "pendulum/worn_fitted.toml"},
     {"weak", "worn pendulum, weak motor", "pendulum/worn_weak.toml", "pendulum/weak.toml",
      "pendulum/worn_fitted.toml"}}};

/// As LoopSettings has them.
inline constexpr double kRandomForces = 0.05, kTempering = 14;

/// A way of using the robot.
struct GapMethod {
  const char *key, *label;
  CalibrationStrategy strategy;
  bool residual, accept;
  bool uncertain = false;
  double forces = 0, tempering = 1;
  bool oracle = false;
};
/// The first policy of a model is trained once for all that have it, with residuals or without.
inline constexpr std::array<GapMethod, 10> kGapMethods{
    {{"default", "Plumbline: residual and acceptance", CalibrationStrategy::kDefault, true, true},
     {"residual", "residual without acceptance", CalibrationStrategy::kDefault, true, false},
     {"prior", "the prior, fixed", CalibrationStrategy::kPrior, true, false},
     {"forces", "the prior, random forces", CalibrationStrategy::kPrior, true, false, false,
      kRandomForces},
     {"step", "step-based SimOpt (paper)", CalibrationStrategy::kStep, true, false},
     {"posterior", "posterior alone", CalibrationStrategy::kDefault, false, false},
     {"acceptance", "acceptance without residual", CalibrationStrategy::kDefault, false, true},
     {"tempered", "tempered posterior", CalibrationStrategy::kDefault, false, false, false, 0,
      kTempering},
     {"wide", "the prior, contact uncertain, too", CalibrationStrategy::kPrior, true, false, true},
     {"oracle", "oracle: TRPO on the robot itself", CalibrationStrategy::kPrior, true, false, false,
      0, 1, true}}};

}  // namespace plumb
