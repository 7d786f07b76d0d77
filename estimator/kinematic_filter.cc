#include "estimator/kinematic_filter.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace plumb {
namespace {

// Nothing is known of the acceleration at a restart [rad/s^2]; any robot joint is well below it.
constexpr double kInitialAccelerationSd = 100;
// Nor of the velocity where it is not measured [rad/s].
constexpr double kInitialVelocitySd = 10;

constexpr double kInstant = 1e-6;  // [s]

constexpr double Square(double x) { return x * x; }

}  // namespace

KinematicFilter::KinematicFilter(const EstimatorSettings& settings)
    : settings_(settings), jerk_(Square(settings.jerk)), window_(static_cast<size_t>(settings.lag) + 2) {
  covariance_(3, 3) = Square(settings.bias_sd);
}

void KinematicFilter::Restart(double position, double velocity) {
  const bool known = std::isfinite(velocity);
  mean_.head<3>() << position, known ? velocity : 0, 0;
  const double bias_variance = covariance_(3, 3);
  covariance_ = Eigen::Vector4d(Square(settings_.position_sd) + Square(mean_(1) * settings_.timing_sd),
                                Square(known ? settings_.velocity_sd : kInitialVelocitySd), Square(kInitialAccelerationSd),
                                bias_variance)
                    .asDiagonal();
  jerk_ = Square(settings_.jerk);
  step_ = {};
  pending_ = 0;
  predicted_mean_ = mean_;
  predicted_covariance_ = covariance_;
  Keep();
}

void KinematicFilter::Predict(double dt, double effort_step, const ImpactSpeeds& impact, double step_after) {
  transition_ << 1, dt, dt * dt / 2, 0,  //
      0, 1, dt, 0,                       //
      0, 0, 1, 0,                        //
      0, 0, 0, 1;
  const double d2 = dt * dt, d3 = d2 * dt, d4 = d3 * dt, d5 = d4 * dt;
  Eigen::Matrix4d jerk;  // integral of the white jerk over dt
  jerk << d5 / 20, d4 / 8, d3 / 6, 0,  //
      d4 / 8, d3 / 3, d2 / 2, 0,       //
      d3 / 6, d2 / 2, dt, 0,           //
      0, 0, 0, 0;
  // Where the effort steps, the acceleration may. So may an impact make it; when, nobody knows: at the beginning, and to readings of a moment
  // ago it is so much more jerk.
  const double impact_variance =
      Square(settings_.ground_impact * impact.ground) + Square(settings_.stop_impact * impact.stop);
  jerk_ = Square(settings_.jerk) + impact_variance / dt;
  const double since = (1 - step_after) * dt;
  step_ = {settings_.effort_step * effort_step, since};
  const Eigen::Vector4d step = step_.sd * Eigen::Vector4d(since * since / 2, since, 1, 0);
  mean_ = transition_ * mean_;
  covariance_ = transition_ * covariance_ * transition_.transpose() + Square(settings_.jerk) * jerk +
                impact_variance * transition_.col(2) * transition_.col(2).transpose() + step * step.transpose();
  covariance_(3, 3) += Square(settings_.bias_sd) * dt / kBiasWanders;
  predicted_mean_ = mean_;
  predicted_covariance_ = covariance_;
}

KinematicFilter::Row KinematicFilter::RowOf(Quantity quantity, double age, double spread) const {
  const double span = std::abs(age);
  // A reading from before the step, or the part of an average that is, knows nothing of it.
  const double before = std::max(0.0, age - step_.since), old = std::max(0.0, age + spread - step_.since),
                unknown_velocity = step_.sd * before, unknown_position = unknown_velocity * before / 2;
  switch (quantity) {
    case Quantity::kPosition:
      // A measurement time that is off by timing_sd displaces the position by velocity * timing_sd.
      return {{1, -age, age * age / 2, 0},
              Square(settings_.position_sd) + Square(mean_(1) * settings_.timing_sd) + jerk_ * std::pow(span, 5) / 20 +
                  Square(unknown_position)};
    case Quantity::kVelocity:
    case Quantity::kRate:
      return {{0, 1, -age, quantity == Quantity::kRate ? 1. : 0.},
              Square(settings_.velocity_sd) + jerk_ * span * span * span / 3 + Square(unknown_velocity)};
    case Quantity::kAcceleration:
      // The average of a random walk differs from its end by a third of the walk's variance.
      return {{0, 0, 1, 1}, Square(settings_.acceleration_sd) + jerk_ * (span + spread / 3) + Square(step_.sd * std::min(1.0, old / (spread + kInstant)))};
  }
  return {};
}

KinematicFilter::Innovation KinematicFilter::Expect(Quantity quantity, double value, double age, double spread) const {
  const Row row = RowOf(quantity, age, spread);
  return {value - row.of_state.dot(mean_), row.of_state.dot(covariance_ * row.of_state) + row.variance};
}

KinematicFilter::Innovation KinematicFilter::Correct(Quantity quantity, double value, double age, double spread) {
  const Row row = RowOf(quantity, age, spread);
  const Eigen::Vector4d shared = covariance_ * row.of_state;
  const Innovation innovation{value - row.of_state.dot(mean_), row.of_state.dot(shared) + row.variance};
  const Eigen::Vector4d gain = shared / innovation.variance;
  mean_ += gain * innovation.value;
  // Joseph's form keeps the covariance symmetric and positive.
  const Eigen::Matrix4d keep = Eigen::Matrix4d::Identity() - gain * row.of_state.transpose();
  covariance_ = keep * covariance_ * keep.transpose() + gain * row.variance * gain.transpose();
  return innovation;
}

void KinematicFilter::Keep() {
  if (pending_ > 0) {
    Step& last = At(pending_ - 1);
    last.gain =
        predicted_covariance_.ldlt().solve(transition_ * last.filtered_covariance).transpose();
  }
  // Nobody has taken the oldest.
  if (pending_ == static_cast<int>(window_.size())) {
    ++oldest_;
    --pending_;
  }
  Step& step = At(pending_++);
  step.filtered_mean = mean_;
  step.filtered_covariance = covariance_;
  step.mean_change = mean_ - predicted_mean_;
  step.covariance_change = covariance_ - predicted_covariance_;
}

// The backward pass, unrolled forwards: what each later step's readings changed comes back through the gains in between.
KinematicFilter::Smoothed KinematicFilter::TakeOldest() {
  const Step& oldest = At(0);
  Smoothed smoothed{oldest.filtered_mean.head<2>(), oldest.filtered_covariance.topLeftCorner<2, 2>()};
  Eigen::Matrix<double, 2, 4> back = Eigen::Matrix<double, 2, 4>::Identity();
  for (int i = 1; i < pending_; ++i) {
    back = (back * At(i - 1).gain).eval();
    smoothed.mean += back * At(i).mean_change;
    smoothed.covariance += back * At(i).covariance_change * back.transpose();
  }
  oldest_ = (oldest_ + 1) % static_cast<int>(window_.size());
  --pending_;
  return smoothed;
}

}  // namespace plumb
