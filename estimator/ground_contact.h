#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "plumb/robot_state_t.hpp"
#include "robot/contact_points.h"
#include "robot/kinematics.h"

namespace plumb {

/// Judges the hypothesis that a point rests on the ground by residuals that should then be zero:
/// its height, its vertical velocity and, where a base is told by its legs, the speed at which it
/// slides along the ground, each over its standard deviation. No forces, hence no masses, but in
/// the height of a base that stands on soft ground (LegOdometry::Settings::give): what calibration
/// learns from it is not what it put in. Not thread-safe.
class ContactTest {
 public:
  /// Uncertainty of the ground rather than of the robot: it is not quite even, and gives way.
  static constexpr double kHeightSd = 1e-3;  ///< [m]
  static constexpr double kRiseSd = 0.2;     ///< [m/s]
  static constexpr double kSlideSd = 0.5;    ///< [m/s]
  /// Bounds of the sum of the squares, of height and rise alone chi-square with two degrees of
  /// freedom if the point rests: 86 % and 98.9 % of it.
  static constexpr double kTouches = 4, kLeaves = 9;

  /// Of the sphere's lowest point. Standard deviations as the filter has them, without those above.
  struct Motion {
    double height, height_sd;        ///< [m] above the ground
    double rise, rise_sd;            ///< [m/s]
    double slide = 0, slide_sd = 0;  ///< [m/s] along the ground; 0, 0: not judged by it
  };
  /// A point that is surely below ground level may sink: it presses the ground in. What is lower
  /// than the ground never speaks against contact. @return touching()
  bool Judge(const Motion& motion);
  void Restart() { touching_ = false; }
  bool touching() const { return touching_; }

 private:
  bool touching_ = false;
};

/// ROBOT_STATE's contact flags: the points of ContactPoints(robot) on the plane z = 0 of the base.
/// Does not allocate after construction. Not thread-safe.
class GroundContact {
 public:
  explicit GroundContact(const RobotDescription& robot);

  int32_t num_points() const { return static_cast<int32_t>(points_.size()); }
  /// Fills in state.contact from the rest of it, one each: -1 = not known, because the state is not
  /// valid. The coordinates' errors are taken as independent; how the errors of positions turn into
  /// ones of the vertical velocity is neglected.
  void Judge(robot_state_t& state);
  /// [m/s] at which a point may meet the ground, or moves in it, within `ahead` [s] from the last
  /// state: the fastest one's. 0 if that state was not valid.
  double ImpactSpeed(double ahead) const;

 private:
  std::vector<ContactPoint> points_;
  std::vector<ContactTest> tests_;
  std::vector<ContactTest::Motion> motions_;
  Kinematics kinematics_;
  Eigen::Matrix3Xd jacobian_;
};

}  // namespace plumb
