// Which feet rest, and where: the part of LegOdometry that knows of the ground.

#include "estimator/leg_odometry.h"
#include "estimator/leg_smoother.h"
#include "estimator/square.h"

#include <algorithm>
#include <cmath>

namespace plumb {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kAnywhereSd = 1;  // [m] of a foot that has just been set down, horizontally
// [m] sd below which the filter itself can tell whether a foot rests
constexpr double kRestHeightKnown = 0.03;
constexpr double kAstray = 8;       // standard deviations below the ground
constexpr double kSurelyAbove = 5;  // standard deviations above it

}  // namespace

// [m/s] of the centre of a sphere that rolls on the ground.
Eigen::Vector3d LegOdometry::RollingOf(const Foot& foot) const {
  const Vector3d rate = orientation_ * (rate_ - rate_bias_ + foot.rate);
  return foot.radius * rate.cross(Vector3d::UnitZ());
}

ContactTest::Motion LegOdometry::MotionOf(const Foot& foot) const {
  const Matrix3d to_world = orientation_.toRotationMatrix();
  const Vector3d arm = to_world * foot.centre, rate = rate_ - rate_bias_;
  const Vector3d moves = to_world * (rate.cross(foot.centre) + foot.velocity);
  // Along an axis: position + arm; velocity + moves. Their derivatives by the error.
  const auto& p = covariance_;
  const auto variance = [&](Eigen::Index block, const Vector3d& axis, const Vector3d& lever,
                            const Vector3d& by_bias) {
    const Vector3d by_angle = lever.cross(axis);
    return axis.dot(p.block<3, 3>(block, block) * axis) +
           by_angle.dot(p.block<3, 3>(kAngle, kAngle) * by_angle) +
           by_bias.dot(p.block<3, 3>(kRateBias, kRateBias) * by_bias) +
           2 * axis.dot(p.block<3, 3>(block, kAngle) * by_angle) +
           2 * axis.dot(p.block<3, 3>(block, kRateBias) * by_bias) +
           2 * by_angle.dot(p.block<3, 3>(kAngle, kRateBias) * by_bias);
  };
  const auto speed_sd = [&](const Vector3d& axis) {
    const Vector3d in_body = to_world.transpose() * axis, by_rate = in_body.cross(foot.centre);
    return std::sqrt(std::max(0.0, variance(kVelocity, axis, moves, by_rate) +
                                       in_body.dot(foot.velocity_variance * in_body) +
                                       Square(s_.rate_sd) * by_rate.squaredNorm()));
  };
  const Vector3d up = Vector3d::UnitZ(), up_in_body = to_world.row(2);
  const double height = variance(kPosition, up, arm, Vector3d::Zero()) +
                        up_in_body.dot(foot.centre_variance * up_in_body);
  // of the sphere's lowest point
  Vector3d slides = allowed_ * (velocity_ + moves - RollingOf(foot));
  slides.z() = 0;
  const double slide = slides.norm();
  return {.height = position_.z() + arm.z() - foot.radius,
          .height_sd = std::sqrt(std::max(0.0, height) + Square(s_.ground_sd)),
          .rise = velocity_.z() + moves.z(),
          .rise_sd = speed_sd(up),
          .slide = slide,
          .slide_sd = slide > 0 ? speed_sd(slides / slide) : 0};
}

// Of two points the higher cannot rest on level ground, however high both of them may be.
void LegOdometry::CompareWithLowest(const Foot& foot, std::span<const Foot> feet,
                                    ContactTest::Motion* motion) const {
  const Vector3d arm = orientation_ * foot.centre;
  double above = 0, variance = 0;
  for (const Foot& other : feet) {
    const Vector3d between = arm - orientation_ * other.centre;
    const double by = between.z() - foot.radius + other.radius;
    if (by <= above) continue;
    above = by;
    const Vector3d by_angle = between.cross(Vector3d::UnitZ());
    variance = by_angle.dot(covariance_.block<3, 3>(kAngle, kAngle) * by_angle);
  }
  motion->height = above;
  motion->height_sd = std::sqrt(std::max(0.0, variance) + 2 * Square(s_.ground_sd));
}

void LegOdometry::Judge(size_t index, std::span<const Foot> feet) {
  const Foot& foot = feet[index];
  ContactTest::Motion motion = MotionOf(foot);
  const bool rested = rests(index);
  if (!rested && motion.height_sd > kRestHeightKnown &&
      motion.height < kSurelyAbove * motion.height_sd) {
    // A height that is as good as unknown excludes nothing and excuses nothing, unless it is surely
    // one in the air; but what falls freely rests on nothing.
    if (borne_ < s_.gravity / 2) return;
    motion.height = 0;
    // In a plane what touches is one foot's: as good as level.
    if (!s_.normal) CompareWithLowest(foot, feet, &motion);
  }
  if (motion.height < -kAstray * motion.height_sd) astray_ = true;
  const bool rests = feet_[index].test.Judge(motion);
  if (rests && !rested) SetDown(index, foot);
  if (!rests && rested) Forget(IndexOf(index));
}

void LegOdometry::Forget(Eigen::Index block) {
  if (smoother_) smoother_->Forgot(block);
  covariance_.middleRows<3>(block).setZero();
  covariance_.middleCols<3>(block).setZero();
}

// Where along the ground, the correction that follows will find out; how high the ground is, is
// known. Whoever lands is seen to rest when the ground has already given way.
void LegOdometry::SetDown(size_t index, const Foot& foot) {
  const Eigen::Index at = IndexOf(index);
  Forget(at);
  feet_[index].place = position_ + orientation_ * foot.centre;
  feet_[index].place.z() = foot.radius - (lands_ ? pressed_ : 0);
  covariance_.block<3, 3>(at, at) = Square(kAnywhereSd) * allowed_;
  covariance_.col(at + 2).setZero();
  covariance_.row(at + 2).setZero();
  covariance_(at + 2, at + 2) = Square(s_.ground_sd);
}

// Feet that rest.
int64_t LegOdometry::Resting() const {
  return std::count_if(feet_.begin(), feet_.end(),
                       [](const Rest& foot) { return foot.test.touching(); });
}

// [m] by which the ground gives way, once it has settled, under each foot that rests.
double LegOdometry::Pressed() const {
  const int64_t resting = Resting();
  if (resting == 0 || !force_) return 0;
  return s_.give * std::max(0.0, force_->z()) / static_cast<double>(resting);
}

// A sphere rolls, creeps, and sinks in or comes up again (an Ornstein-Uhlenbeck process).
void LegOdometry::Wander(size_t index, const Foot& foot) {
  const Eigen::Index at = IndexOf(index);
  Vector3d& place = feet_[index].place;
  place += dt_ * (allowed_ * RollingOf(foot));
  const double keeps = std::exp(-dt_ / s_.settles_in), pressed = foot.radius - Pressed();
  place.z() = pressed + keeps * (place.z() - pressed);
  if (smoother_) smoother_->Scaled(at + 2, keeps);
  covariance_.row(at + 2) *= keeps;
  covariance_.col(at + 2) *= keeps;
  const Vector3d up = Vector3d::UnitZ();
  covariance_.block<3, 3>(at, at) += Square(s_.slip) * dt_ * (allowed_ - up * up.transpose());
  covariance_(at + 2, at + 2) += Square(s_.ground_sd) * (1 - keeps * keeps);
}

}  // namespace plumb
