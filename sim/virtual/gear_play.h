#pragma once

#include <Eigen/Core>
#include <vector>

#include "robot/description.h"
#include "sim/virtual/physics_backend.h"

namespace plumb {

/// Backlash: the rotor of a motor and the joint that it drives are two masses, and between them
/// lies a gap in which neither feels the other. At its ends they push each other with max(0,
/// stiffness x depth + damping x depth'). The teeth are so stiff that rotor and robot swing against
/// each other at kToothFrequency at least, and that the joint's effort limit bends them by kBend of
/// the gap at most; they have kToothDamping of critical damping. The motor's effort acts on the
/// rotor alone. Not thread-safe.
class GearPlay {
 public:
  static constexpr double kToothFrequency = 200;  ///< [Hz]
  static constexpr double kToothDamping = 0.3;
  static constexpr double kBend = 0.1;
  /// [s] of the midpoint rule by which the two go together: at most, and at least
  static constexpr double kLongestStep = 2e-4, kShortestStep = 1e-6;

  /// Of description.virtual_robot.joints. @param robot with known parameters.
  /// @throws std::invalid_argument if one with backlash has a motor gain, a delay or a no-load
  /// speed in its dynamics: those would act on what the teeth exert. Or if its rotor is so light,
  /// or its gap so narrow, that no step is short enough.
  explicit GearPlay(const RobotDescription& robot);

  bool any() const { return !gears_.empty(); }
  /// The rotors are in the middle of their gaps, as fast as their joints.
  void Place(const Eigen::VectorXd& q, const Eigen::VectorXd& v);
  /// As PhysicsBackend::Advance, of both.
  bool Advance(const PhysicsBackend::Vector& effort, double duration, PhysicsBackend& engine);

  /// q and v of the joints as their motors have them.
  const Eigen::VectorXd& q() const { return q_; }
  const Eigen::VectorXd& v() const { return v_; }

 private:
  struct Gear {
    Eigen::Index position, velocity;  // of the joint in q and v
    double half;                      // [rad or m] of the gap
    double rotor;                     // [kg m^2 or kg]
    double stiffness, damping;
    double angle = 0, speed = 0;  // of the rotor
  };
  void Show(const PhysicsBackend& engine);

  std::vector<Gear> gears_;
  double longest_step_ = kLongestStep;  // [s]
  Eigen::VectorXd q_, v_, effort_;
};

}  // namespace plumb
