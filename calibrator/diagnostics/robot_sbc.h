#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "calibrator/inference/sbc.h"
#include "calibrator/motion/transitions.h"
#include "common/batch_runner.h"
#include "sim/model.h"

namespace plumb {

struct RobotSbcOptions {
  int runs = 500;
  int draws = 99;  ///< of each posterior
  uint64_t seed = 1;
  int threads = 1;
  std::function<void(double share)> progress = [](double) {};
};

/// Whether Laplace's posterior of this robot, from motions like these, is what it says: each run
/// draws a robot from the prior, lets it make the recorded steps from the recorded states, adds
/// noise to where it arrives, and infers its parameters from that. Judged are all parameters and
/// all combinations that the motion determines. Has threads of its own; call it from one.
/// @param noise_sd of each entry of (q, v), physical units, > 0. The inference estimates it anew.
/// @throws std::invalid_argument, see WindowErrors.
SbcResult RunRobotSbc(std::shared_ptr<const Model> model, std::span<const Rollout> rollouts,
                      const Eigen::VectorXd& noise_sd, const RobotSbcOptions& options);

}  // namespace plumb
