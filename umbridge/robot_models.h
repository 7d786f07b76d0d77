#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "calibrator/motion/log.h"
#include "common/batch_runner.h"
#include "robot/description.h"
#include "umbridge/service.h"

namespace plumb {

/// Next states are lists of numbers.
/// @throws std::invalid_argument for robots with spherical joints.
void RequireNumbers(const RobotDescription& robot);

/// What a robot's log says of its parameters, as functions of them. Each takes the n parameters in
/// physical units, in the order of robot.parameters; T transitions, v velocities and as many
/// positions:
///   log_likelihood   1: ln likelihood of the one-step errors, up to a constant, with the noise's
///                    scale at its maximum (LogLikelihood); -1e300 for what no robot can have, and
///                    where the simulation fails
///   errors           a number for each reading: one-step errors, predicted less recorded, whitened
///                    (WindowErrors): for the right parameters independent, with mean 0 and
///                    variance 1
///   next_states      2 v T: positions and velocities that are predicted for each transition's end
/// The noise is what a first fit finds, and so is the linearisation that whitens.
class RobotModels {
 public:
  /// Fits once: seconds. @throws std::invalid_argument if there is no uncertain parameter, a
  /// spherical joint, or the logs cannot be used (FitCurriculum).
  RobotModels(const RobotDescription& robot, std::span<const Log> logs, ExecutionOptions execution);
  ~RobotModels();

  /// They must not outlive this. One thread at a time for all of them.
  std::vector<ServedModel> Models();

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace plumb
