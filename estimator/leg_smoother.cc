#include "estimator/leg_smoother.h"

#include <algorithm>
#include <array>

#include "common/time_units.h"
#include "robot/rotation_vector.h"

namespace plumb {
namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr Index kPosition = LegOdometry::kPosition, kVelocity = LegOdometry::kVelocity,
                kAngle = LegOdometry::kAngle, kRateBias = LegOdometry::kRateBias,
                kAccelerationBias = LegOdometry::kAccelerationBias, kFeet = LegOdometry::kFeet;
constexpr size_t kActsPerFoot = 5;  // wander, set down, correct, set down anew, correct

// H', H the derivative of what a correction sees of a foot by the error, times x.
template <class X, class Rows>
void AddSeen(Index foot, const Matrix3d& by_angle, const X& x, Rows& to) {
  to.template middleRows<3>(foot) += x;
  to.template middleRows<3>(kPosition) -= x;
  to.template middleRows<3>(kAngle).noalias() += by_angle.transpose() * x;
}

}  // namespace

LegSmoother::LegSmoother(size_t num_feet, size_t readings) : readings_(readings + 1) {
  const Index size = kFeet + 3 * static_cast<Index>(num_feet);
  for (Reading& reading : readings_) {
    reading.acts.resize(kActsPerFoot * num_feet);
    for (Act& act : reading.acts) act.gain.setZero(size, 3);
    reading.covariance.setZero(size, size);
  }
  adjoint_.setZero(size);
  information_.setZero(size, size);
  row_.setZero(3, size);
  part_.setZero(12, size);
  column_.setZero(size, 3);
}

void LegSmoother::Predicted(double dt, const Matrix3d& by_angle, const Matrix3d& half) {
  Reading& now = reading(count_);
  now.dt = dt;
  now.by_angle = by_angle;
  now.half = half;
  now.num_acts = 0;
}

LegSmoother::Act& LegSmoother::NextAct(Kind kind, Index at) {
  Reading& now = reading(count_);
  Act& act = now.acts[std::min(now.num_acts++, now.acts.size() - 1)];
  act.kind = kind;
  act.at = at;
  return act;
}

void LegSmoother::Scaled(Index entry, double by) { NextAct(Kind::kScale, entry).by = by; }

void LegSmoother::Forgot(Index block) { NextAct(Kind::kForget, block); }

void LegSmoother::Corrected(Index block, const Matrix3d& by_angle, const Vector3d& innovation,
                            const Matrix3d& inverse,
                            const Eigen::Ref<const Eigen::MatrixX3d>& gain) {
  Act& act = NextAct(Kind::kCorrect, block);
  act.by_angle = by_angle;
  act.innovation = innovation;
  act.inverse = inverse;
  act.gain = gain;
}

void LegSmoother::Keep(int64_t utime, const LegOdometry& filter) {
  Reading& now = reading(count_);
  Motion& motion = now.filtered;
  motion.utime = utime;
  motion.position = filter.position();
  motion.velocity = filter.velocity();
  motion.orientation = filter.orientation();
  motion.rate = filter.rate();
  motion.acceleration_change = filter.acceleration_change();
  motion.rate_change = filter.rate_change();
  now.covariance = filter.whole_covariance();
  if (count_ + 1 < readings_.size())
    ++count_;
  else
    first_ = (first_ + 1) % readings_.size();
  earlier_.utime = later_.utime = 0;
  reading(count_).num_acts = 0;
}

// From after an act to before it.
void LegSmoother::Undo(const Act& act) {
  if (act.kind == Kind::kScale) {
    adjoint_[act.at] *= act.by;
    information_.row(act.at) *= act.by;
    information_.col(act.at) *= act.by;
  } else if (act.kind == Kind::kForget) {
    adjoint_.segment<3>(act.at).setZero();
    information_.middleRows<3>(act.at).setZero();
    information_.middleCols<3>(act.at).setZero();
  } else {
    // (1 - K H)' adjoint - H' S^-1 innovation; the same for the information from both sides.
    const Vector3d seen = -(act.gain.transpose() * adjoint_) - act.inverse * act.innovation;
    AddSeen(act.at, act.by_angle, seen, adjoint_);
    row_.noalias() = act.gain.transpose() * information_;
    row_ *= -1;
    AddSeen(act.at, act.by_angle, row_, information_);
    column_.noalias() = information_ * act.gain;
    column_ *= -1;
    information_.middleCols<3>(act.at) += column_;
    information_.middleCols<3>(kPosition) -= column_;
    information_.middleCols<3>(kAngle).noalias() += column_ * act.by_angle;
    // H' S^-1 H
    const std::array<Index, 3> blocks{act.at, kPosition, kAngle};
    const std::array<Matrix3d, 3> h{Matrix3d::Identity(), -Matrix3d::Identity(), act.by_angle};
    for (size_t i = 0; i < 3; ++i) {
      for (size_t k = 0; k < 3; ++k)
        information_.block<3, 3>(blocks[i], blocks[k]) += h[i].transpose() * act.inverse * h[k];
    }
  }
}

// From after a reading to before it.
void LegSmoother::Undo(const Reading& reading) {
  for (size_t i = std::min(reading.num_acts, reading.acts.size()); i-- > 0;) Undo(reading.acts[i]);
  const double dt = reading.dt;
  const Matrix3d by_angle = reading.by_angle.transpose(), by_bias = -dt * reading.half.transpose();
  // The transposed transition: what refers to a row is used before that row changes.
  const auto transpose = [&](auto&& rows) {
    rows.template middleRows<3>(kRateBias) += by_bias * rows.template middleRows<3>(kAngle);
    rows.template middleRows<3>(kAccelerationBias) +=
        by_bias *
        (dt / 2 * rows.template middleRows<3>(kPosition) + rows.template middleRows<3>(kVelocity));
    rows.template middleRows<3>(kAngle) +=
        by_angle *
        (dt / 2 * rows.template middleRows<3>(kPosition) + rows.template middleRows<3>(kVelocity));
    rows.template middleRows<3>(kVelocity) += dt * rows.template middleRows<3>(kPosition);
  };
  transpose(adjoint_);
  transpose(information_);
  information_.transposeInPlace();
  transpose(information_);
}

void LegSmoother::Smooth(const Reading& reading, Motion* motion) {
  *motion = reading.filtered;
  const auto rows = reading.covariance.topRows<12>();
  const Eigen::Matrix<double, 12, 1> error = -(rows * adjoint_);
  motion->position += error.segment<3>(kPosition);
  motion->velocity += error.segment<3>(kVelocity);
  motion->orientation =
      (FromRotationVector(error.segment<3>(kAngle)) * motion->orientation).normalized();
  motion->rate -= error.segment<3>(kRateBias);
  part_.noalias() = rows * information_;
  motion->covariance = reading.covariance.topLeftCorner<12, 12>();
  motion->covariance.noalias() -= part_ * reading.covariance.leftCols<12>();
}

// Reading `earlier` and the one after it.
void LegSmoother::Smooth(size_t earlier) {
  adjoint_.setZero();
  information_.setZero();
  for (size_t i = count_ - 1; i > earlier + 1; --i) Undo(reading(i));
  Smooth(reading(earlier + 1), &later_);
  Undo(reading(earlier + 1));
  Smooth(reading(earlier), &earlier_);
}

const LegSmoother::Motion* LegSmoother::At(int64_t utime) {
  if (count_ < 2 || utime < reading(0).filtered.utime || utime > reading(count_ - 1).filtered.utime)
    return nullptr;
  size_t earlier = count_ - 2;
  while (reading(earlier).filtered.utime > utime) --earlier;
  if (reading(earlier).filtered.utime != earlier_.utime || later_.utime == 0) Smooth(earlier);
  const double period = Seconds(later_.utime - earlier_.utime);
  const double share = Seconds(utime - earlier_.utime) / period, ahead = share * period;
  // As if the acceleration were constant in between.
  const Vector3d change = later_.velocity - earlier_.velocity;
  const Vector3d led_to = earlier_.position + period * (earlier_.velocity + change / 2);
  between_.utime = utime;
  between_.position = earlier_.position + ahead * (earlier_.velocity + share / 2 * change) +
                      share * (later_.position - led_to);
  between_.velocity = earlier_.velocity + share * change;
  between_.orientation = earlier_.orientation.slerp(share, later_.orientation).normalized();
  between_.rate = earlier_.rate + share * (later_.rate - earlier_.rate);
  between_.covariance = (1 - share) * earlier_.covariance + share * later_.covariance;
  // It is not, by as much as it changes from one reading to the next.
  const double off = 2 * share * (1 - share);
  between_.acceleration_change = off * later_.acceleration_change * period;
  between_.rate_change = off * later_.rate_change;
  return &between_;
}

}  // namespace plumb
