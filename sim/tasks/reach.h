#pragma once

#include "sim/tasks/task.h"

namespace plumb {

/// Going to task.target and staying there, for any robot without spherical joints. e is the difference to the
/// target, for a continuous joint the short way round.
///   observation  per joint (sin e, cos e) if it is continuous, else e; then v
///   reward       -(sum (e/s)^2 + 0.01 sum (v/s)^2 + 0.01 sum (u/limit)^2) of the state before the step;
///                s = 1 rad for turning joints, for a slide half its range (1 m where that is unlimited),
///                v/s per second, u of the driven joints
///   start        at rest; target +- task.spread, and where a joint has no spread or 0, anywhere: uniformly between
///                its limits, -pi to pi for a continuous one
/// Never terminates. Errors of predicted states are measured in units of s and 8 s per second: a falling rod of 1 m
/// reaches 7.7 rad/s.
class ReachTask : public Task {
 public:
  /// @throws std::invalid_argument for a spherical joint, and for a joint that may start anywhere but has neither
  /// limits nor a spread.
  explicit ReachTask(const RobotDescription& description) : ReachTask(description, "reach") {}

  void Observe(const State& q, const State& v, std::span<float> observation) const override;
  double Reward(const State& q, const State& v, const State& effort, const State& next_q,
                const State& next_v) const override;
  void InitialState(Random& random, Eigen::Ref<Eigen::VectorXd> q,
                    Eigen::Ref<Eigen::VectorXd> v) const override;

 protected:
  ReachTask(const RobotDescription& description, const std::string& name);

 private:
  struct Coordinate {
    bool endless;         // continuous: e is an angle
    double target;
    double scale;         // s
    double lower, upper;  // of the start
  };
  double Error(size_t i, double q) const;

  std::vector<Coordinate> coordinates_;
};

/// The same, but every joint begins near its target: one without a spread begins at it.
class HoldTask : public ReachTask {
 public:
  explicit HoldTask(const RobotDescription& description) : ReachTask(description, "hold") {}
};

}  // namespace plumb
