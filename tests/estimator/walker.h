#pragma once

#include <cmath>
#include <vector>

#include "common/random.h"
#include "estimator/leg_odometry.h"

namespace plumb::walker {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

inline constexpr double kPeriod = 0.005, kRadius = 0.02, kGravity = 9.81;

inline LegOdometry::Settings Settings() {
  return {.rate_sd = 0.01,
          .rate_bias_sd = 0.01,
          .acceleration_sd = 0.1,
          .acceleration_bias_sd = 0.05,
          .period = kPeriod,
          .angle_sd = 0.02,
          .ground_sd = 3e-3,
          .slip = 5e-3,
          .gravity = kGravity};
}

inline Matrix3d Variance(double sd) { return sd * sd * Matrix3d::Identity(); }

/// A body in space that sways above its feet, after formulas; its feet creep and sink in as the
/// filter takes them to.
class Walker {
 public:
  Walker(uint64_t seed, int num_feet, LegOdometry::Settings settings = Settings())
      : s(settings),
        random(seed, {77}),
        filter(s, static_cast<size_t>(num_feet)),
        places(static_cast<size_t>(num_feet)) {
    for (size_t i = 0; i < places.size(); ++i) {
      const double around = 2 * M_PI * static_cast<double>(i) / num_feet;
      places[i] << 0.3 * std::cos(around), 0.3 * std::sin(around),
          kRadius + s.ground_sd * random.Normal();
    }
    rate_bias = s.rate_bias_sd * Normal();
    acceleration_bias = s.acceleration_bias_sd * Normal();
  }

  Vector3d Normal() { return {random.Normal(), random.Normal(), random.Normal()}; }
  Vector3d Position(double t) const {
    return {0.05 * sway * std::sin(3 * t), 0.04 * sway * std::sin(2 * t),
            0.5 + 0.05 * sway * std::sin(4 * t)};
  }
  Vector3d Velocity(double t) const {
    return {0.15 * sway * std::cos(3 * t), 0.08 * sway * std::cos(2 * t),
            0.2 * sway * std::cos(4 * t)};
  }
  Quaterniond Orientation(double t) const {
    return Quaterniond(Eigen::AngleAxisd(0.3 * sway * std::sin(0.7 * t), Vector3d::UnitZ()) *
                       Eigen::AngleAxisd(0.2 * sway * std::sin(3 * t), Vector3d::UnitY()) *
                       Eigen::AngleAxisd(0.15 * sway * std::sin(2.3 * t), Vector3d::UnitX()));
  }
  /// In the body's axes.
  Vector3d Rate(double t) const {
    const Eigen::AngleAxisd turn(Orientation(t - 1e-4).conjugate() * Orientation(t + 1e-4));
    return turn.angle() / 2e-4 * turn.axis();
  }

  std::vector<LegOdometry::Foot> Feet() {
    std::vector<LegOdometry::Foot> feet(places.size());
    const Matrix3d to_body = Orientation(now).toRotationMatrix().transpose();
    for (size_t i = 0; i < feet.size(); ++i) {
      feet[i].radius = kRadius;
      feet[i].centre = to_body * (places[i] - Position(now)) + 1e-3 * Normal();
      feet[i].velocity =
          -to_body * Velocity(now) - Rate(now).cross(feet[i].centre) + 0.01 * Normal();
      feet[i].rate = -Rate(now);
      feet[i].centre_variance = Matrix3d::Zero();  // a millimetre is what the filter allows any leg
      feet[i].velocity_variance = Variance(0.01);
    }
    return feet;
  }

  void Start(const Quaterniond& wrong = Quaterniond::Identity()) {
    const Vector3d off = s.angle_sd * Normal();
    const Quaterniond noise(Eigen::AngleAxisd(off.norm(), off.normalized()));
    filter.Restart(LegOdometry::Beginning::kStands, Position(0), wrong * noise * Orientation(0),
                   Feet());
  }
  void Step() {
    const double before = now;
    now += kPeriod;
    const Vector3d acceleration =
        (Velocity(now) - Velocity(before)) / kPeriod + kGravity * Vector3d::UnitZ();
    const double keeps = std::exp(-kPeriod / 0.05),
                 pressed = kRadius - s.give * acceleration.z() / static_cast<double>(places.size());
    for (Vector3d& place : places) {
      place.head<2>() += s.slip * std::sqrt(kPeriod) * Normal().head<2>();
      place.z() = pressed + keeps * (place.z() - pressed) +
                  s.ground_sd * std::sqrt(1 - keeps * keeps) * random.Normal();
    }
    filter.Predict(kPeriod, Rate(now) + rate_bias + s.rate_sd * Normal(),
                   Orientation((now + before) / 2).conjugate() * acceleration + acceleration_bias +
                       s.acceleration_sd * Normal());
    filter.Correct(Feet());
  }
  void Run(double duration) {
    for (const double end = now + duration; now < end - kPeriod / 2;) Step();
  }

  Eigen::Matrix<double, 9, 1> Error() const {
    Eigen::Matrix<double, 9, 1> e;
    const Eigen::AngleAxisd turn(Orientation(now) * filter.orientation().conjugate());
    e << Position(now) - filter.position(), Velocity(now) - filter.velocity(),
        turn.angle() * turn.axis();
    return e;
  }

  LegOdometry::Settings s;
  Random random;
  LegOdometry filter;
  std::vector<Vector3d> places;
  Vector3d rate_bias, acceleration_bias;
  double now = 0, sway = 1;
};

}  // namespace plumb::walker
