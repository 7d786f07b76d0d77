#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "calibrator/transitions.h"
#include "sim/simulator.h"
#include "sim/tasks/task.h"

namespace plumb {

/// How far a simulator with given parameters is from what a robot did. One per worker thread; not thread-safe.
/// Parameters are physical, in the description's order. A simulation that is not finite is infinitely far.
class Discrepancy {
 public:
  static constexpr double kDegreesOfFreedom = 4;

  explicit Discrepancy(const RobotDescription& robot);

  /// Step-based (Cui & Hensel): reset to s, apply what was applied, compare with s'. The squared error of one
  /// transition is whitened by the uncertainty of both states, joint by joint:
  ///   e_q has variance  s'_q^2 + s_q^2 + T^2 s_v^2,   e_v has  s'_v^2 + s_v^2,   covariance  T s_v^2,
  /// because an error of v moves the predicted q by T of it. Its expectation is 2 per joint for the truth.
  /// @return mean over transitions and coordinates of |W e|^2: 1 = explained down to the noise.
  double StepError(const Eigen::VectorXd& parameters, std::span<const Rollout> rollouts);

  /// ln p(s' | s, a, parameters) summed over all transitions, up to a constant. Student's t distribution with
  /// kDegreesOfFreedom in d = 2 * joints dimensions (Lange, Little, Taylor, JASA 84, 1989):
  ///   -(nu + d) / 2 sum ln(1 + |W e|^2 / nu)
  /// which is a Gaussian's for errors of the expected size, and hardly minds the few that a late frame or a knock
  /// at the robot made a hundred times as large.
  double LogLikelihood(const Eigen::VectorXd& parameters, std::span<const Rollout> rollouts);

  /// All whitened errors, 2 * joints rows per transition: for Jacobians.
  Eigen::VectorXd Residuals(const Eigen::VectorXd& parameters, std::span<const Rollout> rollouts);

  /// Trajectory-based (Chebotar et al., "Closing the sim-to-real loop", ICRA 2019, eq. 5): simulate each whole
  /// roll-out from its first state; with errors in standard units, smoothed over time by a Gaussian of
  /// `smoothing` seconds, mean over time of |e|_1 + |e|_2^2.
  double TrajectoryError(const Eigen::VectorXd& parameters, std::span<const Rollout> rollouts, double smoothing = 0.1);

  /// Root mean square error, in standard units (Task::state_scale), of predicting `horizon` steps ahead from
  /// every recorded state that has as many gapless successors. NaN if there is none.
  double PredictionError(const Eigen::VectorXd& parameters, std::span<const Rollout> rollouts, int horizon);

 private:
  // Squared whitened error of one transition; writes the errors themselves unless null.
  double StepOnce(const Transition& transition, double* whitened);

  int n_;
  Simulator simulator_;
  Eigen::VectorXd scale_;
};

/// How many transitions there are.
size_t CountTransitions(std::span<const Rollout> rollouts);

}  // namespace plumb
