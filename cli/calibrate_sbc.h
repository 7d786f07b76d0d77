#pragma once

#include <cstddef>
#include <vector>

#include "calibrator/fit/method.h"
#include "calibrator/motion/log.h"
#include "robot/description.h"

namespace plumb {

/// How many posteriors it takes at least: with fewer, simulation-based calibration does not find
/// out ones that are as wrong as can be, that is, whose truths are all on one side of them, all
/// outside them, or all in their very middle. Thread-safe.
/// @param draws of each posterior, 2 at least. @param tests that are made of them.
int FewestPosteriors(int draws, size_t tests);

/// `plumb calibrate --sbc`: looks whether Laplace's posteriors of motions like these cover what
/// they say (RunRobotSbc), and prints that. Has threads of its own; call it from one.
/// @param runs 1 at least.
/// @return exit status: 0; with `strict` 3 if a quantity is not calibrated, or nobody can tell.
/// @throws std::invalid_argument as Calibrate and RunRobotSbc; and what options.progress throws.
int JudgePosteriors(const RobotDescription& robot, const std::vector<Log>& logs,
                    const CalibrationOptions& options, int runs, bool strict);

}  // namespace plumb
