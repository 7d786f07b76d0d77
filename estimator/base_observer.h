#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "estimator/imu_inbox.h"
#include "estimator/leg_odometry.h"
#include "estimator/leg_smoother.h"
#include "plumb/robot_state_t.hpp"
#include "robot/contact_points.h"
#include "robot/description.h"
#include "robot/floating_base.h"
#include "robot/kinematics.h"

namespace plumb {

/// The joints of a base that nothing holds, from its IMU and its legs ([estimator] base = "legs"):
/// a robot's description around LegOdometry. Times are microseconds of one clock. Does not allocate
/// after construction. Not thread-safe.
class BaseObserver {
 public:
  /// Of all joints, one entry each, of which the base's are ignored; variances [rad^2] or [m^2],
  /// [rad^2/s^2] or [m^2/s^2].
  struct Legs {
    Eigen::VectorXd q, v, q_variance, v_variance;
  };

  /// @throws std::invalid_argument, see FloatingBaseOf.
  explicit BaseObserver(const RobotDescription& robot);

  const FloatingBase& base() const { return base_; }
  /// Where Read finds the legs at the time of its reading; num_joints each.
  Legs& legs() { return legs_; }
  /// Nothing is known any more: the next reading with an orientation begins anew.
  void Restart() {
    started_ = false;
    smoother_.Restart();
  }
  /// Somebody has moved it: the IMU's own orientation leans by more than reset_after, and five
  /// standard deviations, from what is known. In a plane never: there the legs tell.
  bool Moved(const ImuInbox::Reading& reading) const;
  /// @param utime of measurement, > that of the reading before; others have no effect.
  void Read(int64_t utime, const ImuInbox::Reading& reading);
  /// Fills in q, v and their standard deviations of the base's joints at a time of at least the
  /// last reading's, under the acceleration and rate of that one. They are NaN before the first.
  void Fill(int64_t utime, robot_state_t& state) const;
  /// The same of a time up to the last reading's, as far as what was read since then tells:
  /// smoothed. Leaves the state as it is where nothing has been read since, or what the filter knew
  /// then is forgotten, because it began anew or that is longer ago than the estimator's lag.
  void Smooth(int64_t utime, robot_state_t& state);
  /// The IMU is heard, and height, tilt and velocity are known well enough to act on: to 0.1 m, 0.1
  /// rad, 0.5 m/s.
  bool valid(int64_t utime) const;

 private:
  void LookAtLegs();
  double CreepSd(const Eigen::Vector3d& direction) const;
  double AngleOf(const Eigen::Quaterniond& orientation) const;
  double TiltSd() const;
  void Set(int joint, double q, double v, double q_sd, double v_sd, robot_state_t& state) const;
  void SetTurn(const Eigen::Quaterniond& orientation, const Eigen::Vector3d& rate,
               const Eigen::Vector3d& angle_sd, const Eigen::Vector3d& rate_sd,
               robot_state_t& state) const;
  Eigen::Quaterniond Begun(const Eigen::Quaterniond& measured) const;

  FloatingBase base_;
  std::vector<ContactPoint> points_;
  // where each joint's coordinates are in q and v
  std::vector<Eigen::Index> position_, velocity_;
  double longest_gap_;        // [s] between readings
  double reset_after_;        // [rad]
  double measured_angle_sd_;  // [rad] of the IMU's own orientation
  double rate_sd_;            // [rad/s] of the gyro
  double creep_;              // [m/s]
  LegOdometry odometry_;
  LegSmoother smoother_;
  Kinematics kinematics_;
  Eigen::VectorXd q_, v_;  // of the legs, the base's at zero
  Legs legs_;
  Eigen::Matrix3Xd jacobian_;
  std::vector<LegOdometry::Foot> feet_;
  int64_t utime_ = 0;
  bool started_ = false;
  double angle_ = 0;  // [rad] of the joint that turns, over many turns; not in space
};

}  // namespace plumb
