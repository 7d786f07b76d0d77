#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <string>
#include <vector>

#include "sim/tasks/task.h"

namespace plumb {

/// Going to task.target and staying there, for any robot. e is the difference to the target, for a
/// continuous joint the short way round; for a spherical one it has three entries, the rotation
/// vector of inverse(target) * q, in the target's axes, the short way round, too: q and -q are one
/// orientation.
///   observation  per joint (sin e, cos e) if it is continuous, else e; then v
///   reward       -(sum (e/s)^2 + 0.01 sum (v/s)^2 + 0.01 sum (u/limit)^2) of the state before the
///                step; s = 1 rad for turning joints, for a slide half its range (1 m where that is
///                unlimited), v/s per second, u of the driven joints
///   start        at rest; target +- task.spread, and where a joint has no spread or 0, anywhere:
///                uniformly between its limits, -pi to pi for a continuous one. A spherical joint's
///                target is turned by a rotation vector with entries within +-spread; without a
///                spread every orientation is as likely
/// Never terminates. Errors of predicted states are measured in units of s and 8 s per second: a
/// falling rod of 1 m reaches 7.7 rad/s. The unit of a quaternion's entries is 1; a small rotation
/// changes them by half its angle. Thread-safe, as Task.
class ReachTask : public Task {
 public:
  /// @throws std::invalid_argument for a joint that may start anywhere but has neither limits nor a
  /// spread.
  explicit ReachTask(const RobotDescription& description) : ReachTask(description, "reach") {}

  void Observe(const State& q, const State& v, std::span<float> observation) const override;
  double Reward(const State& q, const State& v, const State& effort, const State& next_q,
                const State& next_v) const override;
  void InitialState(Random& random, Eigen::Ref<Eigen::VectorXd> q,
                    Eigen::Ref<Eigen::VectorXd> v) const override;

 protected:
  ReachTask(const RobotDescription& description, const std::string& name);

  /// |e| of a joint [rad] or [m]. @param joint index into RobotDescription::joints.
  double Distance(size_t joint, const State& q) const;

 private:
  struct Joint {
    JointDescription::Type type;
    Eigen::Index q, v;  // where it begins in them
    double target = 0;
    Eigen::Quaterniond orientation{1, 0, 0, 0};  // the target of a spherical joint
    double scale = 1;                            // s
    // of the start; of a spherical joint the rotation vector's entries
    double lower = 0, upper = 0;
    bool anywhere = false;  // a spherical joint may start with any orientation
  };
  /// e of a spherical joint.
  static Eigen::Vector3d Turn(const Joint& joint, const State& q);

  std::vector<Joint> joints_;
};

/// The same, but every joint begins near its target: one without a spread begins at it.
class HoldTask : public ReachTask {
 public:
  explicit HoldTask(const RobotDescription& description) : ReachTask(description, "hold") {}
};

}  // namespace plumb
