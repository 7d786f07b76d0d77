#include "estimator/kinematic_filter.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "common/special_numbers.h"
#include "estimator/square.h"

namespace plumb {
namespace {

// Nothing is known of the acceleration at a restart [rad/s^2 or m/s^2]; any robot joint is well
// below it.
constexpr double kInitialAccelerationSd = 100;
// Nor of the velocity where it is not measured [rad/s or m/s].
constexpr double kInitialVelocitySd = 10;

// Of a KinematicState: what every joint has, then what a joint with an inertial sensor has, then
// with an accelerometer.
enum Entry { kPosition, kVelocity, kAcceleration, kStep, kBias, kMark };

int SizeOf(const EstimatorSettings& settings) {
  return settings.acceleration_sd > 0 ? kMark + 1 : settings.bias_sd > 0 ? kBias + 1 : kStep + 1;
}

}  // namespace

KinematicFilter::KinematicFilter(const EstimatorSettings& settings)
    : settings_(settings),
      size_(SizeOf(settings)),
      jerk_(Square(settings.jerk)),
      window_(static_cast<size_t>(settings.lag) + 2) {
  covariance_(kBias, kBias) = Square(settings.bias_sd);
}

void KinematicFilter::Restart(double position, double velocity) {
  const bool known = std::isfinite(velocity);
  const double bias = sound() ? mean_(kBias) : 0,
               bias_variance = sound() ? covariance_(kBias, kBias) : Square(settings_.bias_sd);
  mean_ << position, known ? velocity : 0, 0, 0, bias, 0;
  covariance_ =
      KinematicState(Square(settings_.position_sd) + Square(mean_(kVelocity) * settings_.timing_sd),
                     Square(known ? settings_.velocity_sd : kInitialVelocitySd),
                     Square(kInitialAccelerationSd), 0, bias_variance, 0)
          .asDiagonal();
  since_mark_ = kInfinity;
  next_mark_ = kNaN;
  jerk_ = Square(settings_.jerk);
  step_since_ = 0;
  pending_ = 0;
  predicted_mean_ = mean_;
  predicted_covariance_ = covariance_;
  Keep();
}

// The columns of the transition's transpose, of which most entries are 0 or 1.
template <typename Matrix>
void KinematicFilter::MoveColumns(Matrix& columns) const {
  if (marks_) columns.col(kMark) = columns * mark_;
  columns.col(kPosition) +=
      dt_ * columns.col(kVelocity) + dt_ * dt_ / 2 * columns.col(kAcceleration);
  columns.col(kVelocity) += dt_ * columns.col(kAcceleration);
  columns.col(kStep).setZero();
}

void KinematicFilter::Predict(double dt, double effort_step, const ImpactSpeeds& impact,
                              double step_after) {
  dt_ = dt;
  double unknown_mark = 0;
  marks_ = !std::isnan(next_mark_);
  if (marks_) {
    const Row mark = VelocityAt(next_mark_);
    mark_ = mark.of_state;
    unknown_mark = mark.variance;
    since_mark_ = next_mark_;
    next_mark_ = kNaN;
  }
  since_mark_ += dt;
  const double d2 = dt * dt, d3 = d2 * dt, d4 = d3 * dt, d5 = d4 * dt;
  Eigen::Matrix3d jerk;             // integral of the white jerk over dt
  jerk << d5 / 20, d4 / 8, d3 / 6,  //
      d4 / 8, d3 / 3, d2 / 2,       //
      d3 / 6, d2 / 2, dt;
  // An impact may step the acceleration; when, nobody knows: at the beginning, and to readings of a
  // moment ago it is so much more jerk.
  const Eigen::Vector3d moved(dt * dt / 2, dt, 1);
  const double impact_variance =
      Square(settings_.ground_impact * impact.ground) + Square(settings_.stop_impact * impact.stop);
  jerk_ = Square(settings_.jerk) + impact_variance / dt;
  // Where the effort steps, the acceleration may.
  step_since_ = (1 - step_after) * dt;
  const double step_sd = settings_.effort_step * effort_step;
  const Eigen::Vector4d step =
      step_sd * Eigen::Vector4d(step_since_ * step_since_ / 2, step_since_, 1, 1);

  Eigen::RowVector<double, 6> mean = mean_.transpose();
  MoveColumns(mean);
  mean_ = mean.transpose();
  MoveColumns(covariance_);
  shared_ = covariance_;
  covariance_ = shared_.transpose();
  MoveColumns(covariance_);
  covariance_.topLeftCorner<3, 3>() +=
      Square(settings_.jerk) * jerk + impact_variance * moved * moved.transpose();
  covariance_.topLeftCorner<4, 4>() += step * step.transpose();
  covariance_(kBias, kBias) += Square(settings_.bias_sd) * dt / kBiasWanders;
  covariance_(kMark, kMark) += unknown_mark;
  predicted_mean_ = mean_;
  predicted_covariance_ = covariance_;
}

KinematicFilter::Row KinematicFilter::VelocityAt(double age) const {
  const double span = std::abs(age), before_step = std::max(0.0, age - step_since_);
  return {{0, 1, -age, before_step, 0, 0}, jerk_ * span * span * span / 3};
}

KinematicFilter::Row KinematicFilter::RowOf(Quantity quantity, double age) const {
  switch (quantity) {
    case Quantity::kPosition: {
      const double before_step = std::max(0.0, age - step_since_);
      // A measurement time that is off by timing_sd displaces the position by velocity * timing_sd.
      return {{1, -age, age * age / 2, -before_step * before_step / 2, 0, 0},
              Square(settings_.position_sd) + Square(mean_(kVelocity) * settings_.timing_sd) +
                  jerk_ * std::abs(age) * age * age * age * age / 20};
    }
    case Quantity::kVelocity:
    case Quantity::kRate: {
      Row row = VelocityAt(age);
      if (quantity == Quantity::kRate) row.of_state(kBias) = 1;
      row.variance += Square(settings_.velocity_sd);
      return row;
    }
    case Quantity::kAcceleration: {
      const double window = since_mark_ - age;
      Row row = VelocityAt(age);
      row.of_state(kMark) = -1;
      row.of_state /= window;
      row.of_state(kBias) = 1;
      row.variance = row.variance / Square(window) + Square(settings_.acceleration_sd);
      return row;
    }
  }
  return {};
}

KinematicFilter::Innovation KinematicFilter::Expect(Quantity quantity, double value,
                                                    double age) const {
  const Row row = RowOf(quantity, age);
  return {value - row.of_state.dot(mean_),
          row.of_state.dot(covariance_ * row.of_state) + row.variance};
}

KinematicFilter::Innovation KinematicFilter::Correct(Quantity quantity, double value, double age) {
  const Row row = RowOf(quantity, age);
  const KinematicState shared = covariance_ * row.of_state;
  const Innovation innovation{value - row.of_state.dot(mean_),
                              row.of_state.dot(shared) + row.variance};
  mean_ += shared * (innovation.value / innovation.variance);
  const KinematicState known = shared / std::sqrt(innovation.variance);
  covariance_ -= known * known.transpose();  // symmetric to the last bit
  return innovation;
}

void KinematicFilter::Keep() {
  if (pending_ > 0) {
    switch (size_) {
      case 4:
        FindGain<4>();
        break;
      case 5:
        FindGain<5>();
        break;
      default:
        FindGain<6>();
    }
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

// gain = shared predicted^-1, by Cholesky's factor L of the predicted covariance: column by column,
// all rows at once.
template <int N>
void KinematicFilter::FindGain() {
  KinematicCovariance& gain = At(pending_ - 1).gain;
  gain = shared_;
  Eigen::Matrix<double, N, N> l;
  // of L's diagonal; 0 where there is no uncertainty left, and nothing to be learnt
  Eigen::Matrix<double, N, 1> inverse;
  for (int j = 0; j < N; ++j) {
    for (int i = j; i < N; ++i) {
      l(i, j) = predicted_covariance_(i, j);
      for (int k = 0; k < j; ++k) l(i, j) -= l(i, k) * l(j, k);
    }
    inverse(j) = l(j, j) > 0 ? 1 / std::sqrt(l(j, j)) : 0;
    for (int i = j; i < N; ++i) l(i, j) *= inverse(j);
  }
  for (int j = 0; j < N; ++j) {
    for (int k = 0; k < j; ++k) gain.col(j) -= l(j, k) * gain.col(k);
    gain.col(j) *= inverse(j);
  }
  for (int j = N - 1; j >= 0; --j) {
    for (int k = j + 1; k < N; ++k) gain.col(j) -= l(k, j) * gain.col(k);
    gain.col(j) *= inverse(j);
  }
}

KinematicFilter::Smoothed KinematicFilter::TakeOldest() {
  Smoothed smoothed = size_ == 4   ? SmoothOldest<4>()
                      : size_ == 5 ? SmoothOldest<5>()
                                   : SmoothOldest<6>();
  oldest_ = (oldest_ + 1) % static_cast<int>(window_.size());
  --pending_;
  return smoothed;
}

// The backward pass, unrolled forwards: what each later step's readings changed comes back through
// the gains in between.
template <int N>
KinematicFilter::Smoothed KinematicFilter::SmoothOldest() {
  const Step& oldest = At(0);
  Smoothed smoothed{oldest.filtered_mean.head<2>(),
                    oldest.filtered_covariance.topLeftCorner<2, 2>()};
  using Back = Eigen::Matrix<double, 2, N>;
  Back back = Back::Identity();
  for (int i = 1; i < pending_; ++i) {
    const Step& later = At(i);
    back = Back(back.lazyProduct(At(i - 1).gain.topLeftCorner<N, N>()));
    smoothed.mean += back.lazyProduct(later.mean_change.head<N>());
    const Back changed = back.lazyProduct(later.covariance_change.topLeftCorner<N, N>());
    smoothed.covariance += changed.lazyProduct(back.transpose());
  }
  return smoothed;
}

}  // namespace plumb
