#pragma once

#include <Eigen/Core>
#include <deque>

#include "robot/description.h"

namespace plumb {

/// Position, velocity and acceleration of one joint.
using KinematicState = Eigen::Vector3d;

/// One joint's Kalman filter on a white-noise-jerk model (Bar-Shalom, Li, Kirubarajan, "Estimation with
/// Applications to Tracking and Navigation", 2001, section 6.2.3), with a fixed-lag Rauch-Tung-Striebel smoother.
///
/// It knows no dynamics, so what is inferred from its output about dynamics is not eaten from its own tail. It
/// knows one thing beyond kinematics: acceleration may step when the applied effort steps. The size of that
/// step is left open (a wide zero-mean Gaussian), because it is what calibration wants to learn; without the
/// allowance the filter would round off every such corner and bias the effort's apparent effect.
///
/// Not thread-safe.
class KinematicFilter {
 public:
  explicit KinematicFilter(const EstimatorSettings& settings) : settings_(settings) {}

  /// Starts anew at a measured position [rad] and velocity [rad/s]; NaN: it was not measured.
  void Restart(double position, double velocity);
  /// @param dt [s] since the last call, > 0.
  /// @param effort_step [Nm] change of the mean applied effort against the previous interval.
  void Predict(double dt, double effort_step);
  /// @param age [s] of the measurement; < 0: it was made a little later.
  /// @return the innovation of the position [rad], before the update.
  double Innovation(double position, double age) const { return position - PositionAgo(age).dot(mean_); }
  /// @param velocity NaN: it was not measured. @param age [s] of the measurement; < 0: it was made a little later.
  void Update(double position, double velocity, double age);
  /// There is no measurement of this instant.
  void Skip();

  const KinematicState& mean() const { return mean_; }
  const Eigen::Matrix3d& covariance() const { return covariance_; }

  struct Smoothed {
    KinematicState mean;
    Eigen::Matrix3d covariance;
  };
  /// Number of states that have been filtered and not yet taken out of the window.
  int pending() const { return static_cast<int>(window_.size()); }
  /// The oldest pending state, given all measurements so far; takes it out of the window.
  Smoothed TakeOldest();

 private:
  /// Row of the state's coefficients in what the position was so long ago.
  static Eigen::Vector3d PositionAgo(double age) { return {1, -age, age * age / 2}; }
  void Correct(const Eigen::Vector3d& observe, double measured, double variance);

  // One step of the forward pass, kept for the backward one.
  struct Step {
    Eigen::Matrix3d transition;  // from the previous step
    KinematicState predicted_mean;
    Eigen::Matrix3d predicted_covariance;
    KinematicState filtered_mean;
    Eigen::Matrix3d filtered_covariance;
  };

  EstimatorSettings settings_;
  KinematicState mean_ = KinematicState::Zero();
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Identity();
  Step step_;
  std::deque<Step> window_;
};

}  // namespace plumb
