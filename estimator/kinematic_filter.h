#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "common/special_numbers.h"
#include "estimator/impact.h"
#include "robot/description.h"

namespace plumb {

/// Position, velocity and acceleration of one joint, the step of the acceleration with that of the
/// effort in the latest interval, the bias of the inertial sensor that it carries, and the velocity
/// that it had at the mark.
using KinematicState = Eigen::Matrix<double, 6, 1>;
using KinematicCovariance = Eigen::Matrix<double, 6, 6>;

/// The quantity that a reading is of. A gyro's rate is the velocity plus the bias. An
/// accelerometer's acceleration is the mean since the mark, which is the change of the velocity
/// since then, divided by the time, plus the bias. No joint has both.
enum class Quantity { kPosition, kVelocity, kRate, kAcceleration };

/// One joint's Kalman filter on a white-noise-jerk model (Bar-Shalom, Li, Kirubarajan, "Estimation
/// with Applications to Tracking and Navigation", 2001, section 6.2.3), with a fixed-lag
/// Rauch-Tung-Striebel smoother.
///
/// It knows no dynamics, so that calibration, which infers dynamics from its output, does not find
/// its own assumptions there. It knows one thing beyond kinematics: acceleration may step when the
/// applied effort steps. The size of that step is left open (a wide zero-mean Gaussian), because
/// calibration wants to learn it; without the allowance the filter would round off every such
/// corner and bias the effort's apparent effect. The same where kinematics says that there may be
/// an impact.
///
/// A reading counts at its own time: its row of the observation matrix is that of the state so long
/// ago under an acceleration that is constant but for the effort's step, its variance grows by what
/// the jerk may have done since. (That this is correlated with the filter's own error is neglected,
/// which errs on the cautious side.)
///
/// A step is Predict, any number of Correct, Keep. None of them allocates. Not thread-safe.
class KinematicFilter {
 public:
  /// [s] in which a bias may wander by as much as it may be at the start: warming up takes minutes.
  static constexpr double kBiasWanders = 100;

  explicit KinematicFilter(const EstimatorSettings& settings);

  /// Starts anew at a measured position [rad or m] and velocity [rad/s or m/s]; NaN: it was not
  /// measured. Of the bias it keeps what it knows.
  void Restart(double position, double velocity);
  /// @param dt [s] since the last call, > 0.
  /// @param effort_step [Nm] or [N] of the applied effort. @param step_after share of dt after
  /// which it steps, 0 to 1.
  /// @param impact that there may be meanwhile.
  void Predict(double dt, double effort_step, const ImpactSpeeds& impact = {},
               double step_after = 0);

  /// A reading less its prediction, and the variance of that if filter and noise are right.
  struct Innovation {
    double value, variance;
    /// Normalised innovation squared: 1 on average.
    double nis() const { return value * value / variance; }
  };
  /// @param age [s] of the reading; < 0: it was made a little later.
  /// An acceleration needs a mark: since_mark() finite and above the age.
  Innovation Expect(Quantity quantity, double value, double age) const;
  /// Corrects the state by a reading. @return as Expect, before the correction.
  Innovation Correct(Quantity quantity, double value, double age);
  /// The mark is, from the next step on, where a reading of that age was made.
  void Mark(double age) { next_mark_ = age; }
  /// [s] from the mark to the present; infinite if there is none.
  double since_mark() const { return std::isnan(next_mark_) ? since_mark_ : kInfinity; }
  /// Ends the step.
  void Keep();

  const KinematicState& mean() const { return mean_; }
  const KinematicCovariance& covariance() const { return covariance_; }
  /// Times the bias's sd: beyond it the filter has lost its way.
  static constexpr double kBiasLost = 1000;
  /// Finite, with variances of position and velocity that are some and a bias that may be one.
  /// Otherwise it can only restart, and then forgets the bias, too.
  bool sound() const {
    return mean_.allFinite() && covariance_.allFinite() && covariance_(0, 0) >= 0 &&
           covariance_(1, 1) >= 0 && std::abs(bias()) <= kBiasLost * settings_.bias_sd;
  }
  double bias() const { return mean_(4); }  ///< [rad/s] of a gyro or [m/s^2] of an accelerometer

  struct Smoothed {
    Eigen::Vector2d mean;  ///< position, velocity
    Eigen::Matrix2d covariance;
  };
  /// Number of states that have been filtered and not yet taken out of the window, at most
  /// settings.lag + 1.
  int pending() const { return pending_; }
  /// The oldest pending state, given all measurements so far; takes it out of the window.
  Smoothed TakeOldest();

 private:
  struct Row {
    KinematicState of_state;
    double variance;
  };
  Row RowOf(Quantity quantity, double age) const;
  /// Of the velocity that long ago, but for what all readings have of noise.
  Row VelocityAt(double age) const;
  template <typename Matrix>
  void MoveColumns(Matrix& columns) const;
  // Of the first N entries, those that the joint has: the backward pass is most of the work.
  template <int N>
  void FindGain();
  template <int N>
  Smoothed SmoothOldest();

  // One step of the forward pass, kept for the backward one.
  struct Step {
    KinematicState filtered_mean;
    KinematicCovariance filtered_covariance;
    // smoother's, from the next step to this one; unknown for the newest
    KinematicCovariance gain;
    KinematicState mean_change;             // by this step's readings
    KinematicCovariance covariance_change;  // likewise
  };
  Step& At(int i) { return window_[static_cast<size_t>(oldest_ + i) % window_.size()]; }

  EstimatorSettings settings_;
  int size_;  // entries of the state that such a joint has
  KinematicState mean_ = KinematicState::Zero(), predicted_mean_ = KinematicState::Zero();
  KinematicCovariance covariance_ = KinematicCovariance::Zero(),
                      predicted_covariance_ = KinematicCovariance::Zero();
  // The latest step: its length [s], and of what the mark was made if it was.
  double dt_ = 0;
  bool marks_ = false;
  KinematicState mark_ = KinematicState::Zero();
  // of the state before it with that after it
  KinematicCovariance shared_ = KinematicCovariance::Zero();
  double since_mark_ = kInfinity, next_mark_ = kNaN;
  double jerk_;               // squared spectral density of the last step's, impact included
  double step_since_ = 0;     // [s] from the effort's step in the latest interval to the present
  std::vector<Step> window_;  // ring
  int oldest_ = 0, pending_ = 0;
};

}  // namespace plumb
