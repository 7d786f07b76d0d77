#pragma once

#include <Eigen/Core>
#include <vector>

#include "estimator/impact.h"
#include "robot/description.h"

namespace plumb {

/// Position, velocity and acceleration of one joint, and the bias of the inertial sensor that it carries.
using KinematicState = Eigen::Vector4d;

/// What a reading is of. A gyro's rate is the velocity plus the bias, an accelerometer's acceleration the acceleration
/// plus the bias: no joint has both.
enum class Quantity { kPosition, kVelocity, kRate, kAcceleration };

/// One joint's Kalman filter on a white-noise-jerk model (Bar-Shalom, Li, Kirubarajan, "Estimation with
/// Applications to Tracking and Navigation", 2001, section 6.2.3), with a fixed-lag Rauch-Tung-Striebel smoother.
///
/// It knows no dynamics, so what is inferred from its output about dynamics is not eaten from its own tail. It
/// knows one thing beyond kinematics: acceleration may step when the applied effort steps. The size of that
/// step is left open (a wide zero-mean Gaussian), because it is what calibration wants to learn; without the
/// allowance the filter would round off every such corner and bias the effort's apparent effect. The same where kinematics
/// says that there may be an impact.
///
/// A reading counts at its own time: its row of the observation matrix is that of the state so long ago under constant
/// acceleration, its variance grows by what the jerk may have done since. (That this is correlated with the filter's own
/// error is neglected, which errs on the cautious side.)
///
/// A step is Predict, any number of Correct, Keep. None of them allocates. Not thread-safe.
class KinematicFilter {
 public:
  /// [s] in which a bias may wander by as much as it may be at the start: warming up takes minutes.
  static constexpr double kBiasWanders = 100;

  explicit KinematicFilter(const EstimatorSettings& settings);

  /// Starts anew at a measured position [rad] and velocity [rad/s]; NaN: it was not measured. Of the bias it keeps what
  /// it knows.
  void Restart(double position, double velocity);
  /// @param dt [s] since the last call, > 0.
  /// @param effort_step [Nm] of the applied effort. @param step_after share of dt after which it steps, 0 to 1.
  /// @param impact that there may be meanwhile.
  void Predict(double dt, double effort_step, const ImpactSpeeds& impact = {}, double step_after = 0);

  /// A reading less what was expected of it, and its variance if both are right.
  struct Innovation {
    double value, variance;
    /// Normalised innovation squared: 1 on average.
    double nis() const { return value * value / variance; }
  };
  /// @param age [s] of the reading; < 0: it was made a little later.
  /// @param spread [s] over which an acceleration is the average, up to its time.
  Innovation Expect(Quantity quantity, double value, double age, double spread = 0) const;
  /// Takes it into account. @return what Expect says before.
  Innovation Correct(Quantity quantity, double value, double age, double spread = 0);
  /// Ends the step.
  void Keep();

  const KinematicState& mean() const { return mean_; }
  const Eigen::Matrix4d& covariance() const { return covariance_; }

  struct Smoothed {
    Eigen::Vector2d mean;  ///< position, velocity
    Eigen::Matrix2d covariance;
  };
  /// Number of states that have been filtered and not yet taken out of the window, at most settings.lag + 1.
  int pending() const { return pending_; }
  /// The oldest pending state, given all measurements so far; takes it out of the window.
  Smoothed TakeOldest();

 private:
  struct Row {
    Eigen::Vector4d of_state;
    double variance;
  };
  Row RowOf(Quantity quantity, double age, double spread) const;

  // One step of the forward pass, kept for the backward one.
  struct Step {
    KinematicState filtered_mean;
    Eigen::Matrix4d filtered_covariance;
    Eigen::Matrix4d gain;                // smoother's, from the next step to this one; unknown for the newest
    KinematicState mean_change;          // by this step's readings
    Eigen::Matrix4d covariance_change;   // likewise
  };
  Step& At(int i) { return window_[static_cast<size_t>(oldest_ + i) % window_.size()]; }

  EstimatorSettings settings_;
  KinematicState mean_ = KinematicState::Zero(), predicted_mean_ = KinematicState::Zero();
  Eigen::Matrix4d covariance_ = Eigen::Matrix4d::Zero(), predicted_covariance_ = Eigen::Matrix4d::Zero();
  Eigen::Matrix4d transition_ = Eigen::Matrix4d::Identity();
  double jerk_;  // squared spectral density of the last step's, impact included
  struct {
    double sd = 0, since = 0;  // of the acceleration, and [s] before the present
  } step_;                     // of the effort, in the latest interval
  std::vector<Step> window_;  // ring
  int oldest_ = 0, pending_ = 0;
};

}  // namespace plumb
