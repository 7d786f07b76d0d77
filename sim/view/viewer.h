#pragma once

#include <Eigen/Core>
#include <memory>

#include "robot/description.h"

namespace plumb {

/// A window that shows a robot in three dimensions: Simbody's visualiser. It stays open when this
/// is destroyed, until its user closes it.
class Viewer {
 public:
  /// @throws std::runtime_error if there is no display, or no visualiser is installed.
  explicit Viewer(const RobotDescription& robot);
  ~Viewer();

  /// Shows the robot at a time [s]. Waits, so that what is shown takes as long as it says; a time
  /// before the last one begins a new episode.
  void Show(double time, const Eigen::Ref<const Eigen::VectorXd>& q);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace plumb
