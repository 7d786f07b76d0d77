#pragma once

#include <Eigen/Core>
#include <memory>

#include "robot/description.h"
#include "sim/gear_play.h"
#include "sim/motion_engine.h"

namespace plumb {

/// What moves in a virtual robot. By description.virtual_robot.engine:
///   auto    a Plant, or, where the robot has something that a Plant has not (armature, stops,
///           contact), a Simulator with substeps a tenth as long as calibration's and at most
///           kLongestSubstep: then reality has the simulator's equations, but not its integration
///           errors: what a model of contact gets wrong does not show there
///   mujoco  MuJoCo (see MakeMujocoEngine): another contact, other stops, another integrator than
///           any model has
/// Coulomb friction and backlash of description.virtual_robot.joints come on top. Not thread-safe.
class Mechanism {
 public:
  using Vector = MotionEngine::Vector;
  static constexpr double kLongestSubstep = 1e-4;  ///< [s]

  /// @param robot with known parameters, see Model::Describe.
  /// @throws std::invalid_argument if it cannot be simulated.
  explicit Mechanism(RobotDescription robot);

  /// @throws std::invalid_argument if an entry is not finite or the size is wrong.
  void SetState(const Vector& q, const Vector& v);
  /// Holds the motors' efforts for `duration` [s] >= 0. A state that would not be finite is not
  /// taken on.
  /// @return false then.
  bool Advance(const Vector& effort, double duration);

  const Eigen::VectorXd& q() const { return engine_->q(); }
  const Eigen::VectorXd& v() const { return engine_->v(); }
  /// The same as the motors have it, before the backlash of their gears.
  const Eigen::VectorXd& motor_q() const { return play_.any() ? play_.q() : q(); }
  const Eigen::VectorXd& motor_v() const { return play_.any() ? play_.v() : v(); }

 private:
  std::unique_ptr<MotionEngine> engine_;
  GearPlay play_;
};

}  // namespace plumb
