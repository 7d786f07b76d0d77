#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "calibrator/motion/transitions.h"
#include "common/batch_runner.h"
#include "robot/configuration_space.h"
#include "sim/windows.h"

namespace plumb {

/// A guess of the sensors' noise where nobody says, for each entry of (q, v)'s errors, physical
/// units: a thousandth of the task's units of the state. Only a beginning: the scale of the errors
/// is estimated.
Eigen::VectorXd GuessedNoise(const RobotDescription& robot);

/// The step of each entry of (q, v) in finite differences with respect to the initial state: large
/// against the rounding of a simulation, small against its curvature.
Eigen::VectorXd StartDifferences(const Eigen::VectorXd& noise_sd);

/// The errors of simulators against a robot's record, window by window: reset to a recorded state,
/// apply the recorded efforts for up to `horizon` steps, compare with every recorded state on the
/// way. Windows follow each other without overlap over all gapless stretches of the record; the
/// last of a stretch may be shorter. With horizon 1 a window is a transition.
///
/// Errors are whitened by the uncertainty of the recorded states, the state a window begins with
/// included: that is carried along by the simulator's own sensitivity, and reduced by the window's
/// earlier errors (a Kalman filter of the initial state; errors-in-variables, WhitenWindow). For
/// the right simulator whitened errors are independent, with mean zero and variance one; where the
/// noise is not known (sd NaN) it is `noise_sd`. What has disturbed a transition is part of the
/// uncertainty of its own window.
///
/// Not thread-safe. The same bits for any number of threads and whoever does the work.
class WindowErrors {
 public:
  /// The reading that one row of the errors compares with.
  struct Row {
    int window;
    int rollout, transition;  ///< at whose end
    int coordinate;           ///< 0 ... n - 1: of q's differences, n ... 2 n - 1: of v
  };

  /// @param rollouts must outlive this. @param every k: only every k-th window is kept; >= 1.
  /// @throws std::invalid_argument if there is no transition with an observed end.
  WindowErrors(std::shared_ptr<const Model> model, std::span<const Rollout> rollouts, int horizon,
               ExecutionOptions execution, int every = 1);

  /// Where nobody has read a velocity (ForgetVelocities), the first position of a window tells with
  /// which one it began, and is none of them.
  const std::vector<Row>& rows() const { return rows_; }
  int windows() const { return static_cast<int>(windows_.size()); }
  int num_velocities() const { return static_cast<int>(n_); }
  int parameter_count() const { return simulate_.model().parameters().size(); }
  /// Control steps that one simulator makes.
  int64_t steps() const { return steps_; }

  /// Noise of each entry of (q, v), physical units, where the record does not say.
  const Eigen::VectorXd& noise_sd() const { return noise_sd_; }
  /// Units of (q, v): Task::state_scale.
  const Eigen::VectorXd& state_scale() const { return scale_; }
  void set_noise_sd(const Eigen::VectorXd& sd);
  /// Noise of each entry of (q, v) at the windows' ends, root mean square: as recorded or, where
  /// not, noise_sd().
  Eigen::VectorXd EndNoise() const;
  /// Whether the record says what the noise at the windows' ends is, and that their beginnings are
  /// exact.
  bool noise_known() const;
  bool starts_known() const;
  /// Takes the sensitivity to the initial state, by finite differences, from the simulator with
  /// these parameters. It has to be called before Whitened if any initial state is uncertain, and
  /// costs 2 n + 1 simulators then, nothing else. Where nobody has read the velocities that windows
  /// begin with, it is taken at the states that explain each window best, which are looked for
  /// (Gauss-Newton; an iterated Kalman filter: Bell, Cathey, IEEE Trans. Autom. Control 38, 1993):
  /// kRounds times that.
  /// @return false if that simulator fails: the sensitivity is then that of free motion, q + v t.
  bool Linearise(const Eigen::VectorXd& physical);

  /// Predicted minus recorded, physical units: a row of each, a column for each simulator. NaN from
  /// where it has failed. From the recorded beginnings; where Linearise has looked for better ones,
  /// as the line there has it.
  Eigen::MatrixXd Raw(const Eigen::MatrixXd& physical);
  /// The same whitened. A simulator that fails anywhere has NaN all over.
  Eigen::MatrixXd Whitened(const Eigen::MatrixXd& physical);
  /// ln det of what Whitened divides by: likelihoods whose noise or linearisation differ compare
  /// less this.
  double LogSpread() const;

  /// Of all calls.
  int64_t simulated_steps() const { return simulated_steps_; }
  int64_t failures() const { return failures_; }  ///< windows whose simulation failed

 private:
  struct Start {
    Eigen::VectorXd sd;           // of (q, v)
    Eigen::MatrixXd sensitivity;  // rows of the window x 2 n, physical units; empty until Linearise
    Eigen::VectorXd offset;       // of where it was taken from the record, 2 n; empty = none
  };
  static constexpr int kRounds = 4;  // of looking for beginnings
  void AddWindow(size_t rollout, size_t first, size_t length);
  Eigen::MatrixXd Predict(const Eigen::MatrixXd& physical, std::span<const Window> windows,
                          uint64_t which = 0);
  Eigen::MatrixXd Simulate(const Eigen::MatrixXd& physical, std::span<const Window> windows);
  Eigen::MatrixXd FromRecord(const Eigen::MatrixXd& physical);
  Eigen::MatrixXd Telling(const Eigen::MatrixXd& errors) const;
  Eigen::MatrixXd FreeMotion() const;
  Eigen::MatrixXd Sensitivity(const Eigen::VectorXd& physical, const Eigen::MatrixXd& middle);
  void MoveStarts(const Eigen::MatrixXd& errors);
  Eigen::VectorXd StartSdOf(const Start& start) const;
  double WhitenWindow(size_t window, Eigen::MatrixXd* errors) const;
  const Transition& TransitionOf(const Row& row) const;
  double NoiseOf(const Row& row) const;

  Eigen::Index n_;
  std::span<const Rollout> rollouts_;
  Windows simulate_;
  ConfigurationSpace space_;
  std::vector<Window> windows_;  // from where the sensitivity is taken
  bool looks_for_starts_;        // nobody has read the velocities with which windows begin
  std::vector<Start> starts_;
  std::vector<Row> readings_;            // all that are compared
  std::vector<Row> rows_;                // those that tell
  std::vector<Eigen::Index> telling_;    // where these are among all
  std::vector<Eigen::Index> first_row_;  // reading of each window, and the end
  // first of each step of each window, and the end
  std::vector<std::vector<Eigen::Index>> step_rows_;
  Eigen::VectorXd scale_, noise_sd_;
  int64_t steps_ = 0, simulated_steps_ = 0, failures_ = 0;
  BatchRunner* batches_;
  uint64_t identity_ = 0;  // of the windows
};

}  // namespace plumb
