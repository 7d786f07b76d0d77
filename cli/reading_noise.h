#pragma once

#include <Eigen/Core>
#include <string>

#include "common/random.h"
#include "robot/description.h"

namespace plumb {

/// What sensors add to a state when they read it: independent Gaussian errors, new for every
/// reading.
struct ReadingNoise {
  double q = 0;  ///< [rad or m] standard deviation of each position
  double v = 0;  ///< [rad/s or m/s] of each velocity

  bool any() const { return q > 0 || v > 0; }
  /// Adds the errors to a state: those of q first, in the order of the joints. A spherical joint's
  /// orientation is turned further by a rotation vector with three of them.
  /// @param q_read,v_read as in RobotDescription.
  void Add(const RobotDescription& robot, Random& random, Eigen::VectorXd& q_read,
           Eigen::VectorXd& v_read) const;
};

/// "0.003" is of every reading, "0.001,0.05" of positions and of velocities.
/// @throws std::invalid_argument if it is neither, or one of them is negative or not finite.
ReadingNoise ParseReadingNoise(const std::string& text);

}  // namespace plumb
