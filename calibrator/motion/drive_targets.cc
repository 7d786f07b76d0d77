#include "calibrator/motion/drive_targets.h"

#include <fmt/format.h>

#include <cmath>

#include "robot/physical.h"

namespace plumb {
namespace {

constexpr double kSameGain = 1e-6;  // of it: written with few digits

}  // namespace

DriveTargets::DriveTargets(const CsvReader& table, const RobotDescription& robot,
                           std::vector<int> target, std::vector<int> kp, std::vector<int> kd)
    : table_(table), velocities_(robot.num_velocities()) {
  const std::vector<int> driven = robot.driven();
  for (size_t i = 0; i < driven.size(); ++i) {
    const JointDescription& joint = robot.joints[static_cast<size_t>(driven[i])];
    drives_.push_back({robot.velocity_of(driven[i]), joint.dynamics, target[i], kp[i], kd[i]});
    if (target[i] < 0) continue;
    const std::string column = "target_q/" + joint.name;
    if (!(joint.dynamics.kp > 0)) {
      table.Fail(
          fmt::format("{}: the joint's drive runs no position loop; its kp is missing in "
                      "robot.toml's [joint.dynamics]",
                      column));
    }
    for (const char* kind : {"kp/", "rest/"}) {
      if (robot.IsUncertain(kind + joint.name))
        table.Fail(
            fmt::format("{}: {}{} is an uncertain parameter: which effort a target is "
                        "nobody knows",
                        column, kind, joint.name));
    }
  }
}

Eigen::VectorXd DriveTargets::Effort() const {
  Eigen::VectorXd effort = Eigen::VectorXd::Zero(velocities_);
  for (const Drive& drive : drives_) {
    RequireGain(drive.kp, drive.dynamics.kp), RequireGain(drive.kd, drive.dynamics.kd);
    if (drive.target < 0) continue;
    const double target = table_.Number(drive.target);
    if (std::abs(target) > kGreatestQuantity) {
      table_.Fail(fmt::format("'{}' is {}: beyond {} nothing is a robot's",
                              table_.names()[static_cast<size_t>(drive.target)], target,
                              kGreatestQuantity));
    }
    effort(drive.velocity) = drive.dynamics.kp * (target - drive.dynamics.rest);
  }
  return effort;
}

void DriveTargets::RequireGain(int column, double ours) const {
  if (column < 0) return;
  const double theirs = table_.Number(column);
  if (std::abs(theirs - ours) <= kSameGain * std::abs(ours)) return;
  table_.Fail(
      fmt::format("'{}' is {}, but {} in robot.toml's [joint.dynamics]: a log has one gain "
                  "for each drive",
                  table_.names()[static_cast<size_t>(column)], theirs, ours));
}

}  // namespace plumb
