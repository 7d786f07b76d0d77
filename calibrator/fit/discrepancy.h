#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "calibrator/motion/transitions.h"
#include "common/batch_runner.h"
#include "robot/configuration_space.h"
#include "sim/tasks/task.h"
#include "sim/windows.h"

namespace plumb {

/// How far simulators are from a robot's record. Parameters are physical, in the description's
/// order, one column per simulator; so are results. A simulation that fails is infinitely far, and
/// counted. Uses `threads` threads inside; not thread-safe itself. The same bits for any number of
/// threads.
class Discrepancy {
 public:
  static constexpr double kDegreesOfFreedom = 4;

  /// @throws std::invalid_argument if there is no simulator of the robot.
  explicit Discrepancy(const RobotDescription& robot, ExecutionOptions execution = {});

  /// Step-based (Cui & Hensel): reset to s, apply what was applied, compare with s'. The squared
  /// error of one transition is whitened by the uncertainty of both states (WhitenWindow, with the
  /// sensitivity of free motion), joint by joint:
  ///   e_q has variance  s'_q^2 + s_q^2 + T^2 s_v^2,   e_v has  s'_v^2 + s_v^2,
  ///   covariance  T s_v^2,
  /// because an error of v moves the predicted q by T of it. Its expectation is 2 per joint for the
  /// truth.
  /// @return mean over transitions and coordinates of |W e|^2: 1 = explained down to the noise.
  Eigen::VectorXd StepError(const Eigen::MatrixXd& parameters, std::span<const Rollout> rollouts);

  /// ln p(s' | s, a, parameters) summed over all transitions, up to a constant. Student's t
  /// distribution with kDegreesOfFreedom in d = 2 * num_velocities dimensions (Lange, Little,
  /// Taylor, JASA 84, 1989):
  ///   -(nu + d) / 2 sum ln(1 + |W e|^2 / nu)
  /// which is a Gaussian's for errors of the expected size, and hardly minds the few that a late
  /// frame or a knock at the robot made a hundred times as large.
  Eigen::VectorXd LogLikelihood(const Eigen::MatrixXd& parameters,
                                std::span<const Rollout> rollouts);

  /// All whitened errors, 2 * num_velocities rows per transition, the speed's before the
  /// position's: for Jacobians.
  Eigen::MatrixXd Residuals(const Eigen::MatrixXd& parameters, std::span<const Rollout> rollouts);

  /// Trajectory-based (Chebotar et al., "Closing the sim-to-real loop", ICRA 2019, eq. 5): simulate
  /// each whole roll-out from its first state; with errors in standard units, smoothed over time by
  /// a Gaussian of `smoothing` seconds, mean over time of |e|_1 + |e|_2^2.
  Eigen::VectorXd TrajectoryError(const Eigen::MatrixXd& parameters,
                                  std::span<const Rollout> rollouts, double smoothing = 0.1);

  /// Root mean square error, in standard units (Task::state_scale), of predicting `horizon` steps
  /// ahead from every recorded state that has as many gapless successors. NaN if there is none.
  Eigen::VectorXd PredictionError(const Eigen::MatrixXd& parameters,
                                  std::span<const Rollout> rollouts, int horizon);

  /// Open-loop replay error [rad^2 or m^2, by joint], as the identification of legged robots'
  /// drives is judged by: each gapless stretch simulated from its first state to its end, with the
  /// recorded efforts; the sum over the joints of the mean squared error of their positions. NaN if
  /// nothing was observed.
  Eigen::VectorXd ReplayError(const Eigen::MatrixXd& parameters, std::span<const Rollout> rollouts);

  /// Simulations of all calls that have failed.
  const Windows::Failures& failures() const { return failures_; }

 private:
  using Ends = std::vector<const Transition*>;
  struct Stretches {
    std::vector<Window> windows;
    Ends first;  // transition of each
  };
  Stretches WholeStretches(std::span<const Rollout> rollouts) const;
  Eigen::VectorXd ReplayErrorHere(const Eigen::MatrixXd& parameters,
                                  std::span<const Rollout> rollouts);
  static Eigen::VectorXd ColumnSums(const Eigen::MatrixXd& values);
  void OneStep(std::span<const Rollout> rollouts, std::vector<Window>* windows, Ends* ends) const;
  void Predict(const Eigen::MatrixXd& parameters, std::span<const Window> windows,
               const Windows::Visit& visit, bool last_only = true);
  Eigen::VectorXd TrajectoryErrorHere(const Eigen::MatrixXd& parameters,
                                      std::span<const Rollout> rollouts, double smoothing);
  Eigen::VectorXd PredictionErrorHere(const Eigen::MatrixXd& parameters,
                                      std::span<const Rollout> rollouts, int horizon);
  template <class Compute>
  Eigen::VectorXd Batch(uint64_t identity, const Eigen::MatrixXd& parameters,
                        const Compute& compute);
  Eigen::MatrixXd SquaredStepErrors(const Eigen::MatrixXd& parameters,
                                    std::span<const Rollout> rollouts);

  Eigen::Index n_;
  ConfigurationSpace space_;
  Windows windows_;
  Eigen::VectorXd scale_;
  Windows::Failures failures_;
  BatchRunner* batches_;
};

}  // namespace plumb
