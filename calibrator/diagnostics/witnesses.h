#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "calibrator/diagnostics/misspecification.h"
#include "calibrator/fit/one_step.h"
#include "calibrator/fit/window_errors.h"

namespace plumb {

/// The transitions that can bear witness against a model although the states that they begin with
/// are noisy.
///
/// Errors of a right model are whitened by what the simulator's slope makes of the noise. That is
/// right where the simulator is linear over the noise. Where a contact or a stop begins within it,
/// errors are not normal, and larger than whitened ones should be: such a transition tells of the
/// noise rather than of the model. Which these are depends on the reading that a transition begins
/// with, and not on how it ends, so leaving them out leaves the others' errors as they are.
///
/// Points on a sphere of radius sqrt(2 n) standard deviations, in opposite pairs along randomly
/// turned axes, stand for the noise (a spherical cubature rule; Genz, Monahan, SIAM J. Sci. Comput.
/// 19, 1998): a pair's difference gives the slope, its mean less the middle what is not linear, the
/// bend. A transition is a witness if the bend's root mean square is at most kLargestBend standard
/// deviations of each whitened error. Immutable; thread-safe.
class Witnesses {
 public:
  static constexpr double kLargestBend = 0.25;

  /// @param rows of one-step errors, in ascending order of transitions. @param physical of the
  /// parameters. @param noise_sd of each entry of (q, v) where the record does not say: the one
  /// that was estimated. Simulates a few dozen times as many steps as there are.
  Witnesses(OneStep& step, std::span<const WindowErrors::Row> rows, const Eigen::VectorXd& physical,
            const Eigen::VectorXd& noise_sd);

  /// What errors of witnesses are about.
  const std::vector<WindowErrors::Row>& rows() const { return rows_; }
  int count() const { return static_cast<int>(blocks_.size()); }
  /// @param raw errors, or differences of such, in physical units: of all rows, any number of
  /// columns. @return whitened, of the witnesses.
  Eigen::MatrixXd Whiten(const Eigen::MatrixXd& raw) const;

 private:
  struct Block {
    Eigen::Index first, count;    // among all rows
    Eigen::MatrixXd sensitivity;  // count x 2 n, and what has disturbed it
    Eigen::VectorXd start_sd, end_sd;
  };
  std::vector<Block> blocks_;
  std::vector<WindowErrors::Row> rows_;
};

/// Where each transition began, as far as the reading before it tells: the state that the simulator
/// leads to from there, 2 n x steps. Unlike the reading itself it shares no noise with the
/// transition's error, so that errors of a right model cannot depend on it. The first one of a
/// stretch has nothing but its reading. Simulates as many steps as there are.
Eigen::MatrixXd PredictStarts(OneStep& step, const Eigen::VectorXd& physical);

/// What simulators predict of each row, from these states: a column for each column of parameters,
/// physical units. NaN where a simulation fails.
Eigen::MatrixXd PredictRows(OneStep& step, std::span<const WindowErrors::Row> rows,
                            const Eigen::MatrixXd& physical, const Eigen::MatrixXd& starts);

/// The transitions of the rows, each from its state among `starts`. Simulates as many steps as
/// there are.
std::vector<Whereabouts> FindWhereabouts(OneStep& step, std::span<const WindowErrors::Row> rows,
                                         const Eigen::VectorXd& physical,
                                         const Eigen::MatrixXd& starts);

}  // namespace plumb
