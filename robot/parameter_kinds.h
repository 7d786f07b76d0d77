#pragma once

#include <initializer_list>
#include <iterator>
#include <limits>

#include "common/config.h"

/// The numbers of a robot's simulator that may be uncertain: where they are, and what they are
/// called in robot.toml and in the paths of parameters. A new kind is a member here, its line in
/// the table after it, and the physics that uses it. Plain data: not thread-safe. Tables: constant.
namespace plumb {

/// Standard acceleration of free fall, ISO 80000-3 [m/s^2].
inline constexpr double kStandardGravity = 9.80665;

/// The joints that have a number. One coordinate: not spherical. Driven: with a motor.
enum class JointGroup { kAll, kOneCoordinate, kDriven };

/// A joint's motion besides inertia and gravity. The defaults say that there is none of it.
/// Real is double, or a pack with one robot per lane (sim/dynamics/real.h).
template <class Real>
struct JointDynamicsOf {
  static constexpr double kLongestDelay = 0.5;  ///< [s]

  Real armature{};               ///< [kg m^2] or [kg] >= 0: inertia of the rotor, seen at the joint
  Real damping{};                ///< [Nm s/rad] or [N s/m] >= 0: viscous friction
  Real friction{};               ///< [Nm] or [N] >= 0: Coulomb friction
  Real stiffness{};              ///< [Nm/rad] or [N/m] >= 0 of a spring
  Real rest{};                   ///< [rad] or [m] where the spring is relaxed, and the drive's loop
  Real motor_gain = Real{} + 1;  ///< effort at the joint per effort commanded, >= 0
  /// [s] 0 to kLongestDelay between an effort's command and its effect, beyond what was recorded
  Real delay{};
  Real sensor_delay{};  ///< [s] 0 to kLongestDelay: a reading is of the state so long ago
  Real sensor_bias{};   ///< [rad] or [m]: what a reading of the position adds to it
  /// [rad/s] or [m/s] > 0: speed at which the motor's back-EMF leaves it no effort. At speed w in
  /// the effort's own direction the effort is at most effort_limit * (1 - w / no_load_speed), as of
  /// a DC motor at its full voltage.
  Real no_load_speed = Real{} + std::numeric_limits<double>::infinity();
  /// (0, 1]: the share of the motor's effort that its gear passes on while it drives the joint;
  /// driven by it, the motor brakes with all of its effort
  Real gear_efficiency = Real{} + 1;
  Real kp{};  ///< [Nm/rad] or [N/m] >= 0 of the drive's own position loop, see DriveEffort
  Real kd{};  ///< [Nm s/rad] or [N s/m] >= 0 of it
};
using JointDynamics = JointDynamicsOf<double>;

/// Above zero, however little.
inline constexpr Range kAboveZero{std::numeric_limits<double>::denorm_min(),
                                  std::numeric_limits<double>::max()};

/// One number of JointDynamics: "<name>/<joint>" among parameters, `key` in [joint.dynamics].
struct JointParameterKind {
  const char* name;
  const char* key;
  double JointDynamics::*member;
  const char *unit_turning, *unit_sliding;
  const char* noun;  ///< for messages of physics that have no such number
  Range in_file;     ///< that robot.toml may give
  Range values;      ///< that a parameter may have
  /// How large a surprise is still a likely one, where the number is not fitted; 0: it is never
  /// suspected to be wrong.
  struct {
    double least = 0;                         ///< at 0; else 0.3 of its value, if that is more
    bool of_effort = false;                   ///< least is in units of the largest effort limit
    JointGroup joints = JointGroup::kDriven;  ///< of which it is suspected
  } surprise;
  JointGroup joints;     ///< that have it
  bool in_urdf = false;  ///< `key` is an attribute of URDF's <dynamics>, too
};

/// In the order of the members. What comes later comes at the end: posteriors of before still fit
/// their robots then (robot/physics_fingerprint.cc).
// clang-format off
inline constexpr JointParameterKind kJointParameterKinds[] = {
    // name, key, member, units, noun, in file, values, surprise, joints, in URDF
    {"armature", "armature", &JointDynamics::armature, "kg m^2", "kg", "the armature",
     {0, 1e9}, kNotNegative, {1e-3, true}, JointGroup::kAll},
    {"damping", "damping", &JointDynamics::damping, "Nm s/rad", "N s/m", "the damping",
     {0, 1e9}, kNotNegative, {0.01, true, JointGroup::kAll}, JointGroup::kAll, true},
    {"friction", "friction", &JointDynamics::friction, "Nm", "N", "the friction",
     {0, 1e9}, kNotNegative, {0.05, true, JointGroup::kAll}, JointGroup::kAll, true},
    {"stiffness", "stiffness", &JointDynamics::stiffness, "Nm/rad", "N/m", "the spring",
     {0, 1e9}, kAboveZero, {0.05, true}, JointGroup::kOneCoordinate},
    {"rest", "rest", &JointDynamics::rest, "rad", "m", "the spring",
     {-1e9, 1e9}, kFinite, {}, JointGroup::kOneCoordinate},
    {"gain", "motor_gain", &JointDynamics::motor_gain, "", "", "the motor's gain",
     {0, 1e9}, kNotNegative, {0.1}, JointGroup::kDriven},
    {"delay", "delay", &JointDynamics::delay, "s", "s", "delays and sensor errors",
     {0, JointDynamics::kLongestDelay}, {0, JointDynamics::kLongestDelay}, {0.003},
     JointGroup::kDriven},
    {"sensor_delay", "sensor_delay", &JointDynamics::sensor_delay,
     "s", "s", "delays and sensor errors",
     {0, JointDynamics::kLongestDelay}, {0, JointDynamics::kLongestDelay},
     {0.003, false, JointGroup::kOneCoordinate}, JointGroup::kOneCoordinate},
    {"sensor_bias", "sensor_bias", &JointDynamics::sensor_bias,
     "rad", "m", "delays and sensor errors",
     {-1e9, 1e9}, kFinite, {0.02, false, JointGroup::kOneCoordinate}, JointGroup::kOneCoordinate},
    {"no_load_speed", "no_load_speed", &JointDynamics::no_load_speed,
     "rad/s", "m/s", "the no-load speed",
     {1e-9}, kAboveZero, {}, JointGroup::kDriven},
    {"gear_efficiency", "gear_efficiency", &JointDynamics::gear_efficiency,
     "", "", "the gear's losses",
     {1e-9, 1}, {1e-9, 1}, {}, JointGroup::kDriven},
    {"kp", "kp", &JointDynamics::kp, "Nm/rad", "N/m", "the drive's own loop",
     {0, 1e9}, kNotNegative, {}, JointGroup::kDriven},
    {"kd", "kd", &JointDynamics::kd, "Nm s/rad", "N s/m", "the drive's own loop",
     {0, 1e9}, kNotNegative, {}, JointGroup::kDriven},
};
// clang-format on
static_assert(sizeof(JointDynamics) == std::size(kJointParameterKinds) * sizeof(double));

/// The first number that the joint has, other than by default, and that is not among `known`; null
/// if there is none. For physics that do not model all of them.
inline const JointParameterKind* FirstNotAmong(std::initializer_list<double JointDynamics::*> known,
                                               const JointDynamics& dynamics) {
  constexpr JointDynamics kDefault;
  for (const JointParameterKind& kind : kJointParameterKinds) {
    bool is_known = dynamics.*kind.member == kDefault.*kind.member;
    for (const auto member : known) is_known = is_known || member == kind.member;
    if (!is_known) return &kind;
  }
  return nullptr;
}

/// Where a robot touches the ground, the plane z = 0 of the base: a force
/// max(0, stiffness * depth + damping * depth') along z, and Coulomb friction.
template <class Real>
struct ContactOf {
  Real stiffness;   ///< [N/m] > 0
  Real damping;     ///< [N s/m] >= 0
  Real friction;    ///< coefficient >= 0
  Real slip_speed;  ///< [m/s] > 0 below which friction is viscous
};
/// A joint beyond its position limits is pushed back by stiffness * depth + damping * depth'.
template <class Real>
struct StopOf {
  Real stiffness;  ///< [Nm/rad] or [N/m] > 0
  Real damping;    ///< [Nm s/rad] or [N s/m] >= 0
};
/// The numbers that belong to no single link or joint.
template <class Real>
struct WorldOf {
  Real gravity = Real{} + kStandardGravity;  ///< [m/s^2] >= 0, along -z of the base
  ContactOf<Real> contact{};                 ///< zeros where nothing touches the ground
  StopOf<Real> stop{};                       ///< zeros where joints move on beyond their limits
};
using World = WorldOf<double>;

/// One number of the world: its path among parameters is its path in robot.toml's [simulation].
struct WorldParameterKind {
  enum class Table { kSimulation, kContact, kLimit };  ///< [simulation.contact], [simulation.limit]
  const char* name;
  Table table;
  const char* key;
  const char* unit;
  double& (*of)(World& world);
  Range in_file;    ///< that robot.toml may give
  Range values;     ///< that a parameter may have
  double surprise;  ///< still a likely one, as a share of the value
};

// clang-format off
inline constexpr WorldParameterKind kWorldParameterKinds[] = {
    {"gravity", WorldParameterKind::Table::kSimulation, "gravity", "m/s^2",
     [](World& world) -> double& { return world.gravity; }, {0, 1000}, kNotNegative, 0.1},
    {"contact/stiffness", WorldParameterKind::Table::kContact, "stiffness", "N/m",
     [](World& world) -> double& { return world.contact.stiffness; },
     {1e-9, 1e12}, kAboveZero, 0.5},
    {"contact/damping", WorldParameterKind::Table::kContact, "damping", "N s/m",
     [](World& world) -> double& { return world.contact.damping; }, {0, 1e12}, kNotNegative, 0.5},
    {"contact/friction", WorldParameterKind::Table::kContact, "friction", "",
     [](World& world) -> double& { return world.contact.friction; }, {0, 1e6}, kNotNegative, 0.5},
    {"contact/slip_speed", WorldParameterKind::Table::kContact, "slip_speed", "m/s",
     [](World& world) -> double& { return world.contact.slip_speed; },
     {1e-9, 1e6}, kAboveZero, 0.5},
    {"limit/stiffness", WorldParameterKind::Table::kLimit, "stiffness", "Nm/rad",
     [](World& world) -> double& { return world.stop.stiffness; }, {1e-9, 1e12}, kAboveZero, 0.5},
    {"limit/damping", WorldParameterKind::Table::kLimit, "damping", "Nm s/rad",
     [](World& world) -> double& { return world.stop.damping; }, {0, 1e12}, kNotNegative, 0.5},
};
// clang-format on

/// One number of a link with mass: "<name>/<link>" or "<name>/<link>/<entry>" among parameters, see
/// sim/parameters.h. All of them are in the URDF.
struct LinkParameterKind {
  enum class Number { kMass, kInertia, kCenter, kCholesky, kLength };
  const char* name;
  const char* entry;  ///< empty: there is one only
  Number number;
  int index;  ///< of the entry
  const char* unit;
  Range values;
};

inline constexpr Range kExponent{-20, 20};  ///< beyond e^20 an inertia's shape is none any more
inline constexpr LinkParameterKind kLinkParameterKinds[] = {
    {"mass", "", LinkParameterKind::Number::kMass, 0, "kg", kAboveZero},
    {"inertia", "", LinkParameterKind::Number::kInertia, 0, "", kAboveZero},
    {"com", "x", LinkParameterKind::Number::kCenter, 0, "m", kFinite},
    {"com", "y", LinkParameterKind::Number::kCenter, 1, "m", kFinite},
    {"com", "z", LinkParameterKind::Number::kCenter, 2, "m", kFinite},
    {"inertia", "xx", LinkParameterKind::Number::kCholesky, 0, "", kExponent},
    {"inertia", "yy", LinkParameterKind::Number::kCholesky, 1, "", kExponent},
    {"inertia", "zz", LinkParameterKind::Number::kCholesky, 2, "", kExponent},
    {"inertia", "xy", LinkParameterKind::Number::kCholesky, 3, "", kExponent},
    {"inertia", "xz", LinkParameterKind::Number::kCholesky, 4, "", kExponent},
    {"inertia", "yz", LinkParameterKind::Number::kCholesky, 5, "", kExponent},
    {"length", "", LinkParameterKind::Number::kLength, 0, "m", kAboveZero},
};

}  // namespace plumb
