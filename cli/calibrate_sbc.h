#pragma once

#include <vector>

#include "calibrator/fit/method.h"
#include "calibrator/motion/log.h"
#include "robot/description.h"

namespace plumb {

/// `plumb calibrate --sbc`: looks whether Laplace's posteriors of motions like these cover what
/// they say (RunRobotSbc), and prints that. Has threads of its own; call it from one.
/// @param runs 1 at least.
/// @return exit status: 0; with `strict` 3 if a quantity is not calibrated, or nobody can tell.
/// @throws std::invalid_argument as Calibrate and RunRobotSbc; and what options.progress throws.
int JudgePosteriors(const RobotDescription& robot, const std::vector<Log>& logs,
                    const CalibrationOptions& options, int runs, bool strict);

}  // namespace plumb
