#include "estimator/leg_odometry.h"
#include "estimator/kinematic_filter.h"
#include "estimator/leg_smoother.h"
#include "estimator/square.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "robot/rotation_vector.h"

namespace plumb {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kStandsHeightSd = 0.04, kStandsVelocitySd = 0.2;  // [m], [m/s]
constexpr double kMovesHeightSd = 0.2, kMovesVelocitySd = 3;
// [s] in which a bias may wander by as much as it may be at the start
constexpr double kFootSd = 1e-3;   // [m] play and elasticity of a leg
constexpr double kSlipped = 16.3;  // chi-square with three degrees of freedom: 99.9 %
// [s] over which the force on the body is averaged
constexpr double kBorneFor = 0.1;
// [s] after which the force on a body in flight is zero on average
constexpr double kLongFlight = 0.5;
// Share of its weight from which on a body that flies for long is held up. Legs that swing pull and
// push it by half of that and more.
constexpr double kHeldUp = 0.9;
// Share of what a sensor can measure by which an impact's force, or a rate, as a rule is beyond it.
constexpr double kBeyond = 0.1;

// By how much what a reading has clipped may be beyond it.
Vector3d Beyond(const Vector3d& reading, bool clipped) {
  if (!clipped) return Vector3d::Zero();
  Eigen::Index axis;
  reading.cwiseAbs().maxCoeff(&axis);
  return kBeyond * reading[axis] * Vector3d::Unit(axis);
}

Matrix3d Cross(const Vector3d& a) {
  Matrix3d m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

}  // namespace

LegOdometry::LegOdometry(const Settings& settings, size_t num_feet)
    : s_(settings),
      allowed_(Matrix3d::Identity()),
      allowed_turn_(Matrix3d::Identity()),
      feet_(num_feet) {
  if (s_.normal) {
    allowed_turn_ = *s_.normal * s_.normal->transpose();
    allowed_ -= allowed_turn_;
  }
  const Eigen::Index n = IndexOf(num_feet);
  covariance_.setZero(n, n);
  error_.setZero(n);
  seen_.setZero(3, n);
  gain_.setZero(n, 3);
}

double LegOdometry::Sd(Eigen::Index block, const Vector3d& direction) const {
  return std::sqrt(std::max(0.0, direction.dot(covariance_.block<3, 3>(block, block) * direction)));
}

double LegOdometry::rate_sd(const Vector3d& direction) const {
  return std::hypot(s_.rate_sd, Sd(kRateBias, direction));
}

void LegOdometry::Restart(Beginning beginning, const Vector3d& position,
                          const Eigen::Quaterniond& orientation, std::span<const Foot> feet) {
  const bool stands = beginning == Beginning::kStands;
  orientation_ = orientation.normalized();
  position_ = position;
  double lowest = std::numeric_limits<double>::infinity();
  for (const Foot& foot : feet)
    lowest = std::min(lowest, (orientation_ * foot.centre).z() - foot.radius);
  position_.z() = -lowest;
  velocity_ = rate_bias_ = acceleration_bias_ = rate_ = acceleration_ = Vector3d::Zero();
  force_.reset();
  borne_ = lift_ = flight_ = pressed_ = rate_change_ = acceleration_change_ = 0;
  astray_ = false;
  for (Rest& foot : feet_) foot.test.Restart();
  covariance_.setZero();
  const Matrix3d in_body = orientation_.toRotationMatrix().transpose();
  covariance_(kPosition + 2, kPosition + 2) = Square(stands ? kStandsHeightSd : kMovesHeightSd);
  covariance_.block<3, 3>(kVelocity, kVelocity) =
      Square(stands ? kStandsVelocitySd : kMovesVelocitySd) * allowed_;
  covariance_.block<3, 3>(kAngle, kAngle) = Square(s_.angle_sd) * allowed_turn_;
  covariance_.block<3, 3>(kRateBias, kRateBias) =
      Square(s_.rate_bias_sd) * in_body * allowed_turn_ * in_body.transpose();
  covariance_.block<3, 3>(kAccelerationBias, kAccelerationBias) =
      Square(s_.acceleration_bias_sd) * in_body * allowed_ * in_body.transpose();
}

void LegOdometry::Predict(double dt, const Vector3d& rate, const Vector3d& force, Clipped clipped) {
  const Matrix3d start = orientation_.toRotationMatrix();
  const Vector3d in_plane = start.transpose() * allowed_turn_ * start * rate;
  const Vector3d last_rate = force_ ? rate_ : in_plane;
  rate_ = in_plane;
  rate_change_ = (rate_ - last_rate).norm();
  // A gyro's readings are of their times, an accelerometer's are averages.
  const Vector3d turn = dt * ((rate_ + last_rate) / 2 - rate_bias_);
  const Matrix3d half = (orientation_ * FromRotationVector(turn / 2)).toRotationMatrix();
  const Vector3d felt = allowed_ * (half * (force - acceleration_bias_));
  acceleration_change_ = force_ ? (felt - *force_).norm() : 0;
  force_ = felt;
  acceleration_ = felt - s_.gravity * (allowed_ * Vector3d::UnitZ());
  borne_ += (felt.z() - borne_) * -std::expm1(-dt / kBorneFor);
  flight_ += dt;
  lift_ += dt * felt.z();
  pressed_ += (s_.give * std::max(0.0, felt.z()) - pressed_) * -std::expm1(-dt / s_.settles_in);
  dt_ = dt;

  position_ += dt * velocity_ + dt * dt / 2 * acceleration_;
  velocity_ += dt * acceleration_;
  orientation_ = (orientation_ * FromRotationVector(turn)).normalized();

  // F P F': each row of the transition is used before what it refers to changes.
  const Matrix3d by_angle = -dt * Cross(felt), by_acceleration_bias = -dt * half,
                 by_rate_bias = -dt * half;
  if (smoother_) smoother_->Predicted(dt, by_angle, half);
  auto& p = covariance_;
  p.middleRows<3>(kPosition) +=
      dt * p.middleRows<3>(kVelocity) + dt / 2 * (by_angle * p.middleRows<3>(kAngle)) +
      dt / 2 * (by_acceleration_bias * p.middleRows<3>(kAccelerationBias));
  p.middleRows<3>(kVelocity) += by_angle * p.middleRows<3>(kAngle);
  p.middleRows<3>(kVelocity) += by_acceleration_bias * p.middleRows<3>(kAccelerationBias);
  p.middleRows<3>(kAngle) += by_rate_bias * p.middleRows<3>(kRateBias);
  p.middleCols<3>(kPosition) +=
      dt * p.middleCols<3>(kVelocity) + dt / 2 * (p.middleCols<3>(kAngle) * by_angle.transpose()) +
      dt / 2 * (p.middleCols<3>(kAccelerationBias) * by_acceleration_bias.transpose());
  p.middleCols<3>(kVelocity) += p.middleCols<3>(kAngle) * by_angle.transpose();
  p.middleCols<3>(kVelocity) +=
      p.middleCols<3>(kAccelerationBias) * by_acceleration_bias.transpose();
  p.middleCols<3>(kAngle) += p.middleCols<3>(kRateBias) * by_rate_bias.transpose();

  // Readings that are missing were as wrong as the one that is there may be of them. When within a
  // period the force of an impact acted is not known, nor when the rate changed: anywhere in it.
  const double periods = std::max(1.0, dt / s_.period);
  const double within = Square(acceleration_change_ * dt * dt) / 12;
  const Vector3d unread = dt * (allowed_ * (half * Beyond(force, clipped.force))),
                 unturned = dt * (allowed_turn_ * (half * Beyond(rate, clipped.rate)));
  const Matrix3d velocity =
      Square(s_.acceleration_sd * dt * periods) * allowed_ + unread * unread.transpose();
  p.block<3, 3>(kVelocity, kVelocity) += velocity;
  p.block<3, 3>(kPosition, kPosition) += dt * dt / 4 * velocity + within * allowed_;
  p.block<3, 3>(kPosition, kVelocity) += dt / 2 * velocity;
  p.block<3, 3>(kVelocity, kPosition) += dt / 2 * velocity;
  p.block<3, 3>(kAngle, kAngle) +=
      (Square(s_.rate_sd * dt * periods) + Square(rate_change_ * dt) / 12) * allowed_turn_ +
      unturned * unturned.transpose();
  const Matrix3d turns = half.transpose() * allowed_turn_ * half,
                 moves = half.transpose() * allowed_ * half;
  p.block<3, 3>(kRateBias, kRateBias) +=
      Square(s_.rate_bias_sd) * dt / KinematicFilter::kBiasWanders * turns;
  p.block<3, 3>(kAccelerationBias, kAccelerationBias) +=
      Square(s_.acceleration_bias_sd) * dt / KinematicFilter::kBiasWanders * moves;
}

void LegOdometry::Correct(std::span<const Foot> feet) {
  lands_ = Resting() == 0;
  for (size_t i = 0; i < feet.size(); ++i) {
    const bool rested = rests(i);
    if (rested) Wander(i, feet[i]);
    Judge(i, feet);
    if (!rests(i)) continue;
    const bool fits = CorrectBy(i, feet[i]);
    if (!fits && !rested && lift_ < flight_ * s_.gravity / 2) {
      // It swings above the ground: since the last one left nothing has held the body up.
      feet_[i].test.Restart();
      Forget(IndexOf(i));
      continue;
    }
    flight_ = lift_ = 0;
    if (fits) continue;
    // It is elsewhere along the ground; if even the ground is elsewhere, it is we who are.
    if (rested) ++slips_;
    SetDown(i, feet[i]);
    if (!rested || !CorrectBy(i, feet[i])) astray_ = true;
  }
  // Legs may swing, but what flies for long is not held up.
  if (flight_ > kLongFlight && lift_ > kHeldUp * flight_ * s_.gravity) astray_ = true;
}

// place - position - orientation * centre = 0, but for noise. False: that cannot be, and nothing is
// changed.
bool LegOdometry::CorrectBy(size_t index, const Foot& foot) {
  const Eigen::Index at = IndexOf(index);
  const Matrix3d to_world = orientation_.toRotationMatrix();
  const Vector3d arm = to_world * foot.centre;
  // Of what is expected, not of what is seen: a turn of everything about the vertical must remain
  // invisible.
  const Vector3d expected = feet_[index].place - position_;
  const Matrix3d by_angle = Cross(expected);
  const Vector3d innovation = arm - expected;
  const auto& p = covariance_;
  seen_ = p.middleRows<3>(at) - p.middleRows<3>(kPosition);
  seen_ += by_angle * p.middleRows<3>(kAngle);
  Matrix3d spread = seen_.middleCols<3>(at) - seen_.middleCols<3>(kPosition);
  spread += seen_.middleCols<3>(kAngle) * by_angle.transpose();
  spread += to_world * foot.centre_variance * to_world.transpose() +
            Square(kFootSd) * Matrix3d::Identity();
  const Matrix3d inverse = spread.inverse();
  if (innovation.dot(inverse * innovation) > kSlipped) return false;
  gain_.noalias() = seen_.transpose() * inverse;
  if (smoother_) smoother_->Corrected(at, by_angle, innovation, inverse, gain_);
  error_.noalias() = gain_ * innovation;
  covariance_.noalias() -= gain_ * seen_;
  // Rounding must not make it unsymmetric.
  for (Eigen::Index row = 0; row < p.rows(); ++row) {
    for (Eigen::Index column = 0; column < row; ++column) {
      covariance_(row, column) = covariance_(column, row) = (p(row, column) + p(column, row)) / 2;
    }
  }
  Shift();
  return true;
}

void LegOdometry::Shift() {
  position_ += error_.segment<3>(kPosition);
  velocity_ += error_.segment<3>(kVelocity);
  orientation_ = (FromRotationVector(error_.segment<3>(kAngle)) * orientation_).normalized();
  rate_bias_ += error_.segment<3>(kRateBias);
  acceleration_bias_ += error_.segment<3>(kAccelerationBias);
  for (size_t i = 0; i < feet_.size(); ++i) {
    if (rests(i)) feet_[i].place += error_.segment<3>(IndexOf(i));
  }
}

}  // namespace plumb
