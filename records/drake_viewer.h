#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "drake/lcmt_viewer_draw.hpp"
#include "drake/lcmt_viewer_load_robot.hpp"
#include "robot/description.h"

namespace plumb {

/// A robot as the messages that Drake's meldis draws: its shapes, or a stick figure where it has
/// none, in the same colours as everywhere. Not thread-safe.
class DrakeViewer {
 public:
  explicit DrakeViewer(RobotDescription robot);

  /// DRAKE_VIEWER_LOAD_ROBOT: always the same. meldis passes over repetitions.
  const drake::lcmt_viewer_load_robot& load() const { return load_; }
  /// DRAKE_VIEWER_DRAW. @param utime [us] @param q as in RobotDescription. Valid until the next
  /// call. @throws std::invalid_argument if q has the wrong size.
  const drake::lcmt_viewer_draw& Draw(int64_t utime, const Eigen::Ref<const Eigen::VectorXd>& q);

 private:
  const RobotDescription robot_;
  drake::lcmt_viewer_load_robot load_;
  drake::lcmt_viewer_draw draw_;
};

}  // namespace plumb
