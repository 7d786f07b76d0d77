#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "estimator/leg_odometry.h"

namespace plumb {

/// LegOdometry's state some readings ago, with what the readings since then tell of it: a fixed-lag
/// smoother after G. J. Bierman, "Fixed interval smoothing with discrete measurements", Int. J.
/// Control 18 (1973), the modified Bryson-Frazier form: backwards goes an adjoint of the error,
/// through every correction and prediction that the filter made. Unlike the Rauch-Tung-Striebel
/// form it inverts no covariance, and here many are singular: in a plane, and of feet that do not
/// rest.
///
/// Does not allocate after construction. Not thread-safe.
class LegSmoother {
 public:
  /// As LegOdometry has them, but for the rate, which is without its bias.
  struct Motion {
    int64_t utime = 0;
    Eigen::Vector3d position, velocity, rate;
    Eigen::Quaterniond orientation;
    /// of the errors of position, velocity, orientation and the gyro's bias, 3 each
    Eigen::Matrix<double, 12, 12> covariance;
    /// [m/s^2], [rad/s] by which acceleration and rate changed with the reading; between readings
    /// [m/s], [rad/s] by which velocity and rate may be off for that
    double acceleration_change = 0, rate_change = 0;
  };

  /// @param readings of the IMU that are remembered, >= 2.
  LegSmoother(size_t num_feet, size_t readings);

  /// The filter begins anew: what was before tells nothing of what comes.
  void Restart() { count_ = 0; }

  // What the filter does with a reading, in this order; all since the last Keep are of one.
  /// @param by_angle, half of the prediction: of velocity by orientation, and the axes of the body.
  void Predicted(double dt, const Eigen::Matrix3d& by_angle, const Eigen::Matrix3d& half);
  /// An error has been multiplied.
  void Scaled(Eigen::Index entry, double by);
  /// A block of the error is another one's from now on.
  void Forgot(Eigen::Index block);
  void Corrected(Eigen::Index block, const Eigen::Matrix3d& by_angle,
                 const Eigen::Vector3d& innovation, const Eigen::Matrix3d& inverse,
                 const Eigen::Ref<const Eigen::MatrixX3d>& gain);

  /// The reading is done with; what was done since the last is what led here.
  void Keep(int64_t utime, const LegOdometry& filter);

  /// The motion at a time between two readings that are remembered. Cheap where the last call was
  /// of the same two.
  /// @return null if there are none. Valid until the next call.
  const Motion* At(int64_t utime);

 private:
  enum class Kind { kScale, kForget, kCorrect };
  struct Act {
    Kind kind;
    Eigen::Index at;  // block or entry
    double by;        // that it is scaled by
    Eigen::Matrix3d by_angle, inverse;
    Eigen::Vector3d innovation;
    Eigen::MatrixX3d gain;
  };
  struct Reading {
    double dt = 0;
    Eigen::Matrix3d by_angle, half;
    std::vector<Act> acts;  // room for all there may be
    size_t num_acts = 0;
    Motion filtered;
    Eigen::MatrixXd covariance;  // of the whole error
  };

  Act& NextAct(Kind kind, Eigen::Index at);
  Reading& reading(size_t i) { return readings_[(first_ + i) % readings_.size()]; }
  void Undo(const Act& act);
  void Undo(const Reading& reading);
  void Smooth(const Reading& reading, Motion* motion);
  void Smooth(size_t earlier);

  std::vector<Reading> readings_;  // a ring, and the one under way behind the newest
  size_t first_ = 0, count_ = 0;
  // Of bounded size, so that what is computed with them needs no memory but the stack.
  static constexpr int kMax = LegOdometry::kMax;
  // adjoint of the error, and its information
  Eigen::Matrix<double, Eigen::Dynamic, 1, Eigen::ColMajor, kMax, 1> adjoint_;
  LegOdometry::Covariance information_;
  Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::ColMajor, 3, kMax> row_;
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::ColMajor, kMax, 3> column_;
  Eigen::Matrix<double, 12, Eigen::Dynamic, Eigen::ColMajor, 12, kMax> part_;
  Motion earlier_, later_, between_;  // smoothed
};

}  // namespace plumb
