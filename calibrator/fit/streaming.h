#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <memory>
#include <vector>

#include "calibrator/fit/transition_errors.h"
#include "calibrator/inference/group_sums.h"
#include "calibrator/motion/transitions.h"
#include "common/gaussian.h"
#include "sim/model.h"

namespace plumb {

/// Laplace's approximation of the posterior of one-step windows, transition by transition as they
/// arrive. Once settled it equals FitLaplace of WindowErrors with horizon 1, normal noise of
/// estimated scale and no clusters, but where errors jump: slopes are forward differences alone.
/// Where starts are uncertain and their sd is not recorded, their noise is taken from the errors'
/// scale once that is off by more than 5 %, as in FitCurriculum.
///
/// Of each transition its whitened errors and their slopes are kept, as they were at the mode of
/// the time; their squares' sums are quadratic functions, from which mode, covariance and noise
/// follow in closed form (GroupSums). With each new transition some of the others, in turn, are
/// looked at again, and linearised anew where the mode has moved away by 0.01 sd or more.
///
/// A transition that cannot be simulated at the mode is counted, left out, and tried again in its
/// turn.
///
/// Time of an arrival: a bounded number of one-step simulations, whatever has come before. Memory
/// of each transition, with r observed entries, n velocities, p parameters and e cycles of effort:
/// about 8 (8 n + e (n + 1) + r (p + 1) + p) + 600 bytes. Results have the same bits for the same
/// transitions in the same order. Not thread-safe; works in the caller's thread.
class StreamingLaplace {
 public:
  explicit StreamingLaplace(std::shared_ptr<const Model> model);

  /// Takes one more transition. @param episode that it is of: efforts of the one before it, if it
  /// is of the same episode and follows without a gap, may still be on their way where efforts are
  /// delayed.
  /// @return false if it is left out, for now. @throws std::invalid_argument if it cannot be a
  /// window, see Windows::Predict.
  bool Add(const Transition& transition, int64_t episode = 0);

  /// Linearises all that is not linearised at the mode, until nothing moves: the batch's answer.
  /// @return false if that did not come to rest.
  bool Settle();

  int64_t transitions() const { return static_cast<int64_t>(pieces_.size()); }
  int64_t left_out() const { return left_out_; }
  /// Whether there are enough numbers to tell noise from parameters; the answer is the prior
  /// before.
  bool determined() const;

  /// In standard coordinates, see Prior, and in the parameters' own.
  Gaussian standard() const;
  Gaussian posterior() const;
  /// Noise of each entry of (q, v) where the record does not say, as it is assumed, and the errors'
  /// scale relative to what is assumed or recorded; 1 before it is determined.
  const Eigen::VectorXd& noise_sd() const { return noise_sd_; }
  const Eigen::VectorXd& scale() const { return scale_; }

  int64_t simulated_steps() const { return errors_.simulated_steps(); }

 private:
  struct Piece {
    ObservedTransition transition;  // of rollouts_
    int noise_version = -1;         // of the whitening
    // where it is linearised, standard coordinates; empty = it is left out
    Eigen::VectorXd at = {};
    Eigen::MatrixXd errors = {};  // see TransitionErrors::Linearise
  };

  double DistanceFrom(const Eigen::VectorXd& at) const;
  std::vector<size_t> NextInTurn();
  void Linearise(const std::vector<size_t>& indices);
  void Replace(Piece& piece, Eigen::MatrixXd errors);
  void Solve();
  bool AdaptNoise();

  TransitionErrors errors_;
  Eigen::Index n_, p_;
  std::vector<Rollout> rollouts_;  // what came, one for each episode without another in between
  std::deque<Piece> pieces_;       // of each transition, in order
  Eigen::VectorXd mode_;           // standard coordinates
  Eigen::MatrixXd precision_;      // there
  Eigen::VectorXd noise_sd_, scale_;
  int noise_version_ = 0;
  int64_t unknown_rows_ = 0, uncertain_starts_ = 0, left_out_ = 0;
  GroupSums sums_;       // of all pieces
  GroupSums next_sums_;  // of those before next_, summed up anew so that rounding does not pile up
  size_t next_ = 0;      // whose turn it is
};

}  // namespace plumb
