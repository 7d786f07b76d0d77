#include "estimator/kinematic_filter.h"

#include <Eigen/Dense>
#include <cmath>

namespace plumb {
namespace {

// Nothing is known of the acceleration at a restart [rad/s^2]; any robot joint is well below it.
constexpr double kInitialAccelerationSd = 100;

double Square(double x) { return x * x; }

}  // namespace

void KinematicFilter::Restart(double position, double velocity) {
  mean_ = {position, velocity, 0};
  covariance_ = Eigen::Vector3d(Square(settings_.position_sd) + Square(velocity * settings_.timing_sd),
                                Square(settings_.velocity_sd), Square(kInitialAccelerationSd))
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

void KinematicFilter::Update(double position, double velocity) {
  Eigen::Matrix<double, 2, 3> observe = Eigen::Matrix<double, 2, 3>::Identity();
  Eigen::Matrix2d noise = Eigen::Matrix2d::Zero();
  // A measurement time that is off by timing_sd displaces the position by velocity * timing_sd.
  noise(0, 0) = Square(settings_.position_sd) + Square(mean_(1) * settings_.timing_sd);
  noise(1, 1) = Square(settings_.velocity_sd);
  const Eigen::Vector2d innovation = Eigen::Vector2d(position, velocity) - observe * mean_;
  const Eigen::Matrix2d total = observe * covariance_ * observe.transpose() + noise;
  const Eigen::Matrix<double, 3, 2> gain = covariance_ * observe.transpose() * total.inverse();
  mean_ += gain * innovation;
  // Joseph's form keeps the covariance symmetric and positive.
  const Eigen::Matrix3d keep = Eigen::Matrix3d::Identity() - gain * observe;
  covariance_ = keep * covariance_ * keep.transpose() + gain * noise * gain.transpose();
  step_.filtered_mean = mean_;
  step_.filtered_covariance = covariance_;
  window_.push_back(step_);
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
