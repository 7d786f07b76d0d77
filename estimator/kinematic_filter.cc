#include "estimator/kinematic_filter.h"

#include <Eigen/Dense>
#include <cmath>

namespace plumb {
namespace {

// Nothing is known of the acceleration at a restart [rad/s^2]; any robot joint is well below it.
constexpr double kInitialAccelerationSd = 100;
// Nor of the velocity where it is not measured [rad/s].
constexpr double kInitialVelocitySd = 10;

double Square(double x) { return x * x; }

}  // namespace

void KinematicFilter::Restart(double position, double velocity) {
  const bool known = std::isfinite(velocity);
  mean_ = {position, known ? velocity : 0, 0};
  covariance_ = Eigen::Vector3d(Square(settings_.position_sd) + Square(mean_(1) * settings_.timing_sd),
                                Square(known ? settings_.velocity_sd : kInitialVelocitySd), Square(kInitialAccelerationSd))
                    .asDiagonal();
  window_.clear();
  window_.push_back({Eigen::Matrix3d::Identity(), mean_, covariance_, mean_, covariance_});
}

void KinematicFilter::Predict(double dt, double effort_step) {
  Eigen::Matrix3d transition;
  transition << 1, dt, dt * dt / 2,  //
      0, 1, dt,                      //
      0, 0, 1;
  const double d2 = dt * dt, d3 = d2 * dt, d4 = d3 * dt, d5 = d4 * dt;
  Eigen::Matrix3d jerk;  // integral of the white jerk over dt
  jerk << d5 / 20, d4 / 8, d3 / 6,  //
      d4 / 8, d3 / 3, d2 / 2,       //
      d3 / 6, d2 / 2, dt;
  // The mean effort of this interval differs from the last one's: the acceleration may step at its beginning.
  const Eigen::Vector3d step = transition.col(2) * (settings_.effort_step * effort_step);
  mean_ = transition * mean_;
  covariance_ = transition * covariance_ * transition.transpose() + Square(settings_.jerk) * jerk +
                step * step.transpose();
  step_.transition = transition;
  step_.predicted_mean = mean_;
  step_.predicted_covariance = covariance_;
}

void KinematicFilter::Update(double position, double velocity, double age) {
  // A measurement time that is off by timing_sd displaces the position by velocity * timing_sd.
  const double position_variance = Square(settings_.position_sd) + Square(mean_(1) * settings_.timing_sd);
  Correct(PositionAgo(age), position, position_variance);
  if (std::isfinite(velocity)) Correct({0, 1, -age}, velocity, Square(settings_.velocity_sd));
  Skip();
}

void KinematicFilter::Skip() {
  step_.filtered_mean = mean_;
  step_.filtered_covariance = covariance_;
  window_.push_back(step_);
}

void KinematicFilter::Correct(const Eigen::Vector3d& observe, double measured, double variance) {
  const double total = observe.dot(covariance_ * observe) + variance;
  const Eigen::Vector3d gain = covariance_ * observe / total;
  mean_ += gain * (measured - observe.dot(mean_));
  // Joseph's form keeps the covariance symmetric and positive.
  const Eigen::Matrix3d keep = Eigen::Matrix3d::Identity() - gain * observe.transpose();
  covariance_ = keep * covariance_ * keep.transpose() + gain * variance * gain.transpose();
}

KinematicFilter::Smoothed KinematicFilter::TakeOldest() {
  Smoothed smoothed{window_.back().filtered_mean, window_.back().filtered_covariance};
  for (size_t i = window_.size() - 1; i-- > 0;) {
    const Step& step = window_[i];
    const Step& next = window_[i + 1];
    const Eigen::Matrix3d gain = next.predicted_covariance.ldlt()
                                     .solve(next.transition * step.filtered_covariance)
                                     .transpose();
    smoothed.mean = step.filtered_mean + gain * (smoothed.mean - next.predicted_mean);
    smoothed.covariance = step.filtered_covariance +
                          gain * (smoothed.covariance - next.predicted_covariance) * gain.transpose();
  }
  window_.pop_front();
  return smoothed;
}

}  // namespace plumb
