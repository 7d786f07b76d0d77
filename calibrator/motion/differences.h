#pragma once

#include <span>
#include <string>
#include <vector>

#include "calibrator/motion/log.h"
#include "calibrator/motion/motion_table.h"
#include "calibrator/motion/transitions.h"
#include "robot/configuration_space.h"
#include "robot/description.h"

namespace plumb {

/// The joints whose recorded velocities are but differences of their recorded positions: backward,
/// forward or central ones, over a control period.
///
/// Such velocities know nothing that the positions do not. Their errors are those of two positions,
/// divided by the time between: errors of neighbouring transitions depend on each other. And where
/// the acceleration steps, as at every control step, the difference lies beside the velocity by a
/// quarter or a half of what the step makes of it, which a fit takes for dynamics: intervals hold
/// the truth in a third of all cases (docs/diagnostics.md).
///
/// A joint counts if what its velocities differ by from such differences is, root mean square,
/// below kSameDifference of their own second differences. Of any motion's true velocities that
/// ratio is 1/4 where accelerations step, 1/6 where they are smooth, whatever the motion; rounding
/// of the table's numbers is far below. Joints that hardly move do not count, nor does a robot
/// whose simulator makes one semi-implicit step of Euler's in a control period: there backward
/// differences are the velocities. Thread-safe.
std::vector<std::string> DifferencedJoints(const RobotDescription& robot,
                                           std::span<const Rollout> rollouts);

/// What that means, and what to do about it: a sentence.
std::string DifferencesWarning(std::span<const std::string> joints);

/// The joints whose velocities a likelihood does without: `differenced`, or all where the robot's
/// calibration is to use positions alone. Thread-safe.
std::vector<std::string> UnreadJoints(const RobotDescription& robot,
                                      std::span<const std::string> differenced);

/// For what compares single control steps, which need velocities that were read.
/// @param who is compared, for the sentence. @throws std::invalid_argument where UnreadJoints
/// has some of a log: the log, and the joints. Thread-safe.
void RequireVelocities(const RobotDescription& robot, std::span<const Log> logs,
                       const std::string& who);

/// Takes these joints' velocities for what they are: nobody has read them. Those at transitions'
/// ends become NaN; those with which transitions begin become guesses, the central differences of
/// the positions where both neighbours are known, kGuessSd times as unsure as velocities change
/// from one control step to the next (root mean square). Thread-safe.
void ForgetVelocities(const RobotDescription& robot, std::span<const std::string> joints,
                      std::vector<Rollout>* rollouts);

/// A difference's error is at most half of that change. A wide guess, as the positions that it is
/// made of are compared with, too.
inline constexpr double kGuessSd = 2;

inline constexpr double kSameDifference = 0.05;

/// Gives each row of a table without velocities the central difference of its neighbours'
/// positions. Where it has not both, a control period away within a fifth, they stay unknown.
/// Thread-safe.
void DifferencePositions(const ConfigurationSpace& space, double period,
                         std::vector<MotionRow>* rows);

}  // namespace plumb
