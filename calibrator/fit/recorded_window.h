#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>

#include "calibrator/motion/transitions.h"
#include "robot/configuration_space.h"
#include "sim/model.h"
#include "sim/simulator.h"
#include "sim/windows.h"

namespace plumb {

// Recorded motion as simulators' windows begin and end with it. Errors of (q, v) have 2 n entries:
// n of positions (ConfigurationSpace::Difference), n of velocities. All of these are thread-safe.

/// How many transitions of a roll-out from `first` on follow each other without a gap, at least 1.
/// What has disturbed one of them is not simulated: it is a stretch of its own.
size_t StretchLength(const Rollout& rollout, size_t first);

/// Whether something of a transition's end was observed.
bool IsObserved(const Transition& transition);

/// Whether `length` transitions from `first` on follow each other, to an end of which something was
/// observed: predictions over that horizon are judged by it.
bool IsJudged(const Rollout& rollout, size_t first, size_t length);

/// The fewest control steps from which errors tell something of the simulator: one where states are
/// read in full. Where nobody has read a velocity (ForgetVelocities), a window begins with one that
/// its own positions have to tell, and only what they tell besides is about the simulator.
int ShortestWindow(std::span<const Rollout> rollouts);
/// Whether nobody has read entry c of the velocity that a transition begins with.
bool IsUnread(const Transition& transition, Eigen::Index c);
inline constexpr int kUnreadVelocityWindow = 6;

/// `length` recorded steps from transition `first` on: the state that it begins with, and the
/// applied efforts. Where the model delays efforts, the efforts commanded before are part of it, as
/// far back as there is no gap.
/// @param rollout whose efforts the window refers to: they must outlive it.
Window RecordedWindow(const Model& model, const Rollout& rollout, size_t first, size_t length);

/// The simulator as sensors read it when transition i began, the efforts commanded before on their
/// way as far as RecordedWindow knows them.
void BeginTransition(const Rollout& rollout, size_t i, Simulator* simulator);

/// Entry c of the error of (q, v) at a transition's end: predicted minus recorded, physical units,
/// NaN = not observed; and the record's standard deviation, NaN = not known.
double EndError(const ConfigurationSpace& space, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                const Transition& transition, Eigen::Index c);
double EndSd(const Transition& transition, Eigen::Index c);
/// The same, `noise_sd`'s where it is not known, or 0: no reading is exact.
double EndSd(const Transition& transition, Eigen::Index c, const Eigen::VectorXd& noise_sd);
/// The recorded positions nearest to a transition's end: rotations there are counted about these.
const Eigen::VectorXd& NearEnd(const Transition& transition);
/// Whether that entry was observed at all: of a quaternion all or nothing.
bool IsObserved(const ConfigurationSpace& space, const Transition& transition, Eigen::Index c);
/// Mean of the squared errors of (q, v) over the entries that were observed at a transition's end,
/// in units of `scale`, 2 n of them; infinite where the prediction is not finite, or nothing was
/// observed.
double MeanSquaredError(const ConfigurationSpace& space, const Eigen::Ref<const Eigen::VectorXd>& q,
                        const Eigen::Ref<const Eigen::VectorXd>& v, const Transition& transition,
                        const Eigen::VectorXd& scale);
/// The state with which a window begins, moved by so much in entry c.
void MoveStart(const ConfigurationSpace& space, Eigen::Index c, double by, Window* window);

/// Standard deviations of (q, v) at a transition's beginning: 0 = exact, NaN = not known.
Eigen::VectorXd StartSd(const Transition& transition);
/// The same, `noise_sd`'s where they are not known.
Eigen::VectorXd StartSd(const Transition& transition, const Eigen::VectorXd& noise_sd);

/// Makes what has disturbed a transition part of the uncertain state that it begins with, for
/// WhitenWindow: a standard deviation of 1 for each direction, and the direction as a column.
/// @param coordinates of the sensitivity's rows: 0 ... n - 1: q, n ... 2 n - 1: v.
void AddDisturbance(const Transition& transition, std::span<const int> coordinates,
                    Eigen::VectorXd* start_sd, Eigen::MatrixXd* sensitivity);

}  // namespace plumb
