#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "common/csv_reader.h"
#include "robot/description.h"

namespace plumb {

/// Positions for which drives were told to go, as tables of robots have them whose drives run a
/// position loop of their own (DriveEffort): columns target_q/<joint> [rad or m], and kp/<joint>,
/// kd/<joint>, which must be robot.toml's, in every row. As an effort on top of that loop a target
/// is kp (target - rest). Refers to the table, which must outlive it. Not thread-safe.
class DriveTargets {
 public:
  /// @param target, kp, kd columns of each driven joint, -1 = none.
  /// @throws std::runtime_error "file:line: ..." for a target of a joint whose drive runs no loop,
  /// or whose kp or rest is an uncertain parameter: nobody knows the effort then.
  DriveTargets(const CsvReader& table, const RobotDescription& robot, std::vector<int> target,
               std::vector<int> kp, std::vector<int> kd);

  /// Of the table's present row, num_velocities entries; NaN where it is not known.
  /// @throws std::runtime_error "file:line: ..." for a gain that is not robot.toml's.
  Eigen::VectorXd Effort() const;

 private:
  void RequireGain(int column, double ours) const;

  const CsvReader& table_;
  struct Drive {
    Eigen::Index velocity;
    JointDynamics dynamics;
    int target, kp, kd;
  };
  std::vector<Drive> drives_;
  Eigen::Index velocities_;
};

}  // namespace plumb
