#pragma once

#include <span>

#include "calibrator/fit/methods.h"
#include "calibrator/motion/log.h"
#include "calibrator/results/findings.h"
#include "robot/description.h"

namespace plumb {

/// Learns from logs which simulators could have produced the robot's motion, and checks what it has
/// learned, by one of Methods(). The same bits for any number of threads.
/// @throws std::invalid_argument for an unknown discrepancy or method (naming the nearest), or data
/// that cannot be used.
Findings Calibrate(const RobotDescription& robot, std::span<const Log> logs,
                   const CalibrationOptions& options);

}  // namespace plumb
