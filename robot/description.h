#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "robot/parameter_kinds.h"

namespace plumb {

/// A solid of URDF's <visual> or <collision>.
struct Shape {
  enum class Type { kSphere, kCapsule, kCylinder, kBox };
  Type type = Type::kSphere;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();      ///< [m] of its centre, in the link frame
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< its axes in the link's
  /// [m] sphere: (radius, 0, 0); box: edges along x, y, z; capsule and cylinder, which stand along
  /// z: (radius, length, 0), a capsule's length without its caps.
  Eigen::Vector3d size = Eigen::Vector3d::Zero();
};

/// A rigid body. Frames as in URDF: the link frame is at the joint that moves it. What hangs on it
/// by fixed joints belongs to it. A link may have no mass if links beyond it have.
struct LinkDescription {
  std::string name;
  double mass = 0;                                           ///< [kg]
  Eigen::Vector3d center_of_mass = Eigen::Vector3d::Zero();  ///< [m], in the link frame
  /// [kg m^2], about the centre of mass, link axes
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  std::vector<Shape> visuals = {}, collisions = {};
};

/// What a motor of protocol "mit" means by its codes, see drivers/protocols/mit.h. All > 0, at the
/// output shaft.
struct MitRanges {
  double position = 12.5;  ///< [rad] positions are in [-position, position]
  double velocity = 0;     ///< [rad/s] likewise
  double torque = 0;       ///< [Nm] likewise
  double kp = 500;         ///< [Nm/rad] in [0, kp]
  double kd = 5;           ///< [Nm s/rad] in [0, kd]
};

/// What protocol "mit" needs to know besides the node.
struct MitDescription {
  int master = 0;  ///< CAN id of the replies
  MitRanges ranges;
  std::string source;  ///< where the ranges are from: a wrong one scales silently
};

/// How a joint's motor is reached.
struct MotorDescription {
  std::string protocol;  ///< file name in drivers/protocols/, e.g. "cansimple"
  int node = 0;          ///< CAN node id of the protocol
  /// motor turns per joint turn (or per metre / 2 pi for a prismatic joint), > 0
  double gear = 1;
  int sign = 1;                            ///< +1 or -1
  double offset = 0;                       ///< [rad] or [m] joint position at motor position 0
  std::optional<MitDescription> mit = {};  ///< of protocol "mit" and no other
};

/// [estimator]: what the estimator assumes of a coordinate that nothing says more about, in [m] for
/// [rad] where the joint slides, and how it goes about it. See EstimatorOf for a joint's own.
struct EstimatorSettings {
  double position_sd;  ///< [rad] of a reading
  double velocity_sd;  ///< [rad/s]
  double jerk;         ///< [rad/s^3 sqrt(s)]
  double effort_step;  ///< [rad/s^2 per Nm]
  /// sd of the acceleration's step per speed of an impact: of a point with the ground [rad/s^2 per
  /// m/s], of a joint with its stop [rad/s^2 per rad/s]
  double ground_impact = 0, stop_impact = 0;
  /// of a joint with a motor: share of an effort's or a stop's effect that others' have, 0 to 1
  double coupling = 1;
  double timing_sd;    ///< [s]
  int lag;             ///< [measurements]
  double reset_after;  ///< [rad]
  /// [s] of a reading on its way: the constant part, which arrivals cannot tell
  double delay = 0;
  double outage = 0.05;  ///< [s] that a silent joint is predicted before the state is invalid
  /// [rad/s^2 sqrt(s)] spectral density^(1/2) of what the accelerations differ by from the
  /// simulator's, of the filter on its dynamics: [estimator.model]
  double model_acceleration = 0.2;
  /// How the joints of the robot's base are known: as all others, or, if nothing holds it, from its
  /// IMU and its legs.
  enum class Base { kSensors, kLegs };
  Base base = Base::kSensors;
  double ground_sd = 5e-3;  ///< [m] of kLegs: by which the ground is uneven and gives way
  double slip = 0.01;       ///< [m/sqrt(s)] of kLegs: by which a foot that rests creeps
  // Of an IMU on a link that the joint carries; 0: there is none.
  /// [m/s^2] of a slide's acceleration, averaged over a period of the IMU
  double acceleration_sd = 0;
  /// [rad/s] of the gyro, if the joint turns, or [m/s^2] of the accelerometer
  double bias_sd = 0;
};

/// What robot.toml says of a joint's or a sensor's noise; NaN = nothing. Units as in
/// EstimatorSettings.
struct NoiseDescription {
  double position_sd = std::numeric_limits<double>::quiet_NaN();
  double velocity_sd = std::numeric_limits<double>::quiet_NaN();
  double jerk = std::numeric_limits<double>::quiet_NaN();
  double effort_step = std::numeric_limits<double>::quiet_NaN();
  double ground_impact = std::numeric_limits<double>::quiet_NaN();
  double stop_impact = std::numeric_limits<double>::quiet_NaN();
  double coupling = std::numeric_limits<double>::quiet_NaN();
  double delay = std::numeric_limits<double>::quiet_NaN();
};

/// Something on the bus that measures and is no motor.
struct SensorDescription {
  std::string name;
  /// file name in drivers/protocols/: "cia406", an encoder, or "xsens", an IMU
  std::string protocol;
  double period = 0;  ///< [s] > 0 of its readings

  // Of an encoder. It measures a joint: position = sign * radius * angle + offset.
  int joint = -1;     ///< index into joints
  int node = 0;       ///< CANopen node id, 1 to 127
  double counts = 0;  ///< per turn, > 0
  /// counts after which it begins anew, >= 2, <= 2^32; `counts` of a single-turn one
  double range = 0;
  int sign = 1;          ///< +1 or -1
  double offset = 0;     ///< [rad] or [m]
  double radius = 1;     ///< 1 at a joint that turns, [m] > 0 at one that slides: the boom's length
  double max_speed = 0;  ///< [rad/s] > 0 of the shaft; a reading that needs more is a fault
  /// [rad] or [m] > 0 by which it may differ from the motor of its joint, if that has one; infinite
  /// = not compared
  double tolerance = std::numeric_limits<double>::infinity();

  // Of an IMU.
  /// index into links: what it is fixed to
  int link = -1;
  int base = 0;                                            ///< CAN id added to the factory's
  double tick = 1e-4;                                      ///< [s] unit of its SampleTime
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();  ///< its axes in the link's
  double acceleration_sd = 0;                              ///< [m/s^2] > 0
  double rate_bias_sd = 0;                                 ///< [rad/s] >= 0
  double acceleration_bias_sd = 0;                         ///< [m/s^2] >= 0

  /// position_sd and velocity_sd of an IMU: of the angle and of the rate of turn. What moves it,
  /// the joint knows.
  NoiseDescription noise = {};
};

/// How the driver keeps a joint with a motor within its limits, and how the joint stops.
struct JointLimitSettings {
  double position_margin =
      0;  ///< [rad] or [m] >= 0 before a position limit, in which efforts towards it fade
  /// [Nm/s] or [N/s] > 0, away from zero
  double effort_rate = std::numeric_limits<double>::infinity();
  /// [Nm s/rad] or [N s/m] >= 0 of a stop by damping, see DriverSettings::stop
  double damping = 0;
};

/// A moving joint, connecting links[parent] to links[child]. URDF's planar and floating joints are
/// several of these:
///   planar    <name>/x, <name>/y prismatic in the plane, <name>/angle continuous about its normal
///   floating  <name>/x, <name>/y, <name>/z prismatic, <name>/rotation spherical
/// with links without mass in between, named after their joints.
struct JointDescription {
  /// kSpherical: q is a unit quaternion (w, x, y, z) that turns link axes into joint axes, v the
  /// angular velocity in link axes [rad/s], as MuJoCo's ball and free joints have them.
  enum class Type { kRevolute, kContinuous, kPrismatic, kSpherical };
  std::string name;
  Type type = Type::kRevolute;
  int parent = 0;  ///< index into links
  int child = 0;   ///< index into links
  /// [m], in the parent link's frame
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  /// joint frame's axes in the parent link's
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  /// unit vector, in the joint frame
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();
  double lower = 0;           ///< [rad] or [m]; -infinity for a continuous joint
  double upper = 0;           ///< [rad] or [m]; +infinity for a continuous joint
  double effort_limit = 0;    ///< [Nm] or [N], > 0; 0 for a passive joint
  double velocity_limit = 0;  ///< [rad/s] or [m/s], > 0; infinity where the URDF gives none
  bool passive = false;       ///< has no motor
  MotorDescription motor;     ///< of a joint that is not passive
  JointDynamics dynamics;
  JointLimitSettings limits;  ///< of a joint that is not passive
  NoiseDescription noise = {};

  int num_positions() const { return type == Type::kSpherical ? 4 : 1; }
  int num_velocities() const { return type == Type::kSpherical ? 3 : 1; }
  bool IsOf(JointGroup group) const;
};

struct DriverSettings {
  /// What is on the joints when a command has expired, until the driver disarms: nothing, the last
  /// effort that falls linearly to nothing within `ramp`, or -damping * velocity
  /// (JointLimitSettings). Faults and requests disarm at once, whatever this is.
  enum class Stop { kZero, kRamp, kDamping };

  /// [s], scaled time
  double cycle, measurement, expiry, disarm_after, stale_after, heartbeat_timeout, start_guard;
  double telemetry = 0.1;  ///< [s] at which each drive is asked for its temperatures and supply
  Stop stop = Stop::kZero;
  double ramp = 0;          ///< [s] > 0 of kRamp, else 0
  double effort_delay = 0;  ///< [s] 0 to 0.01, from a torque frame's transmission until it acts

  // Beyond these is a fault. What a drive does not report is not judged.
  double max_motor_temperature = 90, max_drive_temperature = 90;     ///< [degC]
  double min_bus_voltage = 0;                                        ///< [V]
  double max_bus_voltage = std::numeric_limits<double>::infinity();  ///< [V]
  /// [s] for which position and velocity may stay the same bit by bit under an effort; 0 = for
  /// ever. Off unless asked for: a joint that holds still on coarse codes, or leans against
  /// something, looks like a dead encoder.
  double stuck_after = 0;
};

struct SimulationSettings {
  /// kSemiImplicit: v += h a(q, v); q += h v, as gym does. kLeapfrog: q += h/2 v; v += h a; q +=
  /// h/2 v.
  enum class Integrator { kSemiImplicit, kLeapfrog };
  Integrator integrator;
  double substep;  ///< [s] a step is divided evenly into such, or up to a tenth longer ones
  double latency;  ///< [s] in training: the previous action acts that long into a step
  /// [rad/s] velocities are clipped to this after each substep; infinity = no clip
  double speed_clip;
  /// gym v0 moves the position with the speed before clipping it; false = with the clipped one.
  bool move_before_clip;
  double gravity = kStandardGravity;  ///< [m/s^2] >= 0, along -z of the base

  using Contact = ContactOf<double>;
  using Stop = StopOf<double>;
  std::optional<Contact> contact;  ///< none: the robot does not touch the ground
  std::optional<Stop> stop;        ///< none: joints move on beyond their limits

  /// What of these may be an uncertain parameter.
  World world() const { return {gravity, contact.value_or(Contact{}), stop.value_or(Stop{})}; }
  /// Sets it; what the robot does not have stays without.
  void set_world(const World& world);
  bool Has(WorldParameterKind::Table table) const;
};

/// One uncertain simulator parameter, named by a path such as "gravity", "mass/pole", "delay/hip":
/// see sim/parameters.h.
struct ParameterDescription {
  enum class Coordinate { kLinear, kLog, kLogit };
  std::string name;
  std::string unit;
  Coordinate coordinate;
  double mean;      ///< prior mean, physical units
  double variance;  ///< prior variance, physical units squared
  /// kLogit: bounds, physical units; lower < mean < upper
  double lower = -std::numeric_limits<double>::infinity();
  double upper = std::numeric_limits<double>::infinity();
  /// Prior in the coordinate. For kLog the Gaussian whose log-normal has that mean and variance:
  /// s^2 = ln(1 + variance/mean^2), m = ln(mean) - s^2/2. For kLogit, x = ln((p - lower) / (upper -
  /// p)), the one that has them to first order: m = x(mean), s^2 = variance * x'(mean)^2.
  double coordinate_mean() const;
  double coordinate_variance() const;
  double ToPhysical(double coordinate_value) const;
  double ToCoordinate(double physical_value) const;
};

struct TaskSettings {
  std::string name;  ///< file name in sim/tasks/
  double period;     ///< [s] control period
  int steps;         ///< per episode
  /// Tasks reach and hold: where to go and how far around it an episode may begin; one each per
  /// coordinate of q.
  std::vector<double> target = {}, spread = {};
};

/// A parameter that is known: not inferred, but other than what the URDF and the TOML file's tables
/// say.
struct FrozenParameter {
  std::string name;
  double value;  ///< physical units
};

struct ControllerSettings {
  double state_timeout;    ///< [s]
  double place_tolerance;  ///< [rad]; times ten [rad/s]
};

struct CalibrationSettings {
  std::string method;  ///< of the live calibrator, see SimOpt
  int samples, updates;
  double kl, min_temperature;
  std::vector<int> horizons;
  double duration = 0;  ///< [s] >= 0 that a calibration takes in virtual time
};

struct TrainingSettings {
  int batch, updates, updates_again;
  std::vector<int> hidden;
  double gamma, lambda, kl, damping;
  int cg_iterations;
  double fisher_fraction;
  double critic_l2, critic_rate;
  int critic_epochs, critic_minibatch;
  bool normalise_values = true;         ///< the critic's targets, by their running mean and sd
  bool normalise_observations = false;  ///< by their running mean and sd
  /// of the episodes, by return, that an update learns from (EPOpt); 1 = all
  double worst_share = 1;
  int worst_after = 100;  ///< updates that learn from all of them
  /// [s] >= 0 that an iteration's training takes in virtual time
  double duration = 0;
  /// sd of what the policy is told [rad or m], [rad/s or m/s]
  double position_noise = 0, velocity_noise = 0;
};

struct HiddenParameter {
  std::string name;  ///< one of the parameters
  double lower, upper;
};

/// What a virtual robot's joint with a motor has besides its JointDynamics: none of the models
/// knows of it.
struct UnmodelledJoint {
  int joint = -1;       ///< index into joints
  double friction = 0;  ///< [Nm] or [N] >= 0 of Coulomb friction
  double delay = 0;     ///< [s] 0 to JointDynamics::kLongestDelay, of efforts
  double backlash = 0;  ///< [rad] or [m] >= 0 between the two ends of the gear's play
  /// [kg m^2] or [kg], seen at the joint, of what is before the play; > 0 if there is any
  double rotor = 0;
};

struct VirtualRobotSettings {
  /// What integrates its motion, see Mechanism.
  enum class Engine { kAuto, kMujoco };

  double watchdog;   ///< [s]
  double heartbeat;  ///< [s]
  int encoder_bits;  ///< per motor turn
  std::vector<HiddenParameter> hidden = {};
  Engine engine = Engine::kAuto;
  std::string engine_source = {};  ///< "file:line:column: " of the engine, for messages
  std::vector<UnmodelledJoint> joints = {};
};

/// Everything there is to know about a robot: robot.urdf and robot.toml, validated. links[0] is the
/// fixed base; joints are in order of URDF depth-first traversal and joint i moves link i + 1. The
/// generalised coordinates q, v are the joints' one after the other: one each, but for spherical
/// joints.
struct RobotDescription {
  std::string file;  ///< the TOML file
  /// of the contents of all files (FNV-1a): a checkpoint of other contents is another's
  uint64_t fingerprint = 0;
  std::string name;
  std::vector<LinkDescription> links;
  std::vector<JointDescription> joints;
  std::string bus_url;
  double bus_bit_rate = 1e6;  ///< [bit/s]
  std::vector<SensorDescription> sensors;
  DriverSettings driver;
  EstimatorSettings estimator;
  SimulationSettings simulation;
  std::vector<ParameterDescription> parameters;  ///< the uncertain ones
  std::vector<FrozenParameter> frozen;           ///< the others
  std::vector<std::string> warnings;  ///< what of the files has no effect, e.g. a collision mesh
  TaskSettings task;
  ControllerSettings controller;
  CalibrationSettings calibration;
  TrainingSettings training;
  VirtualRobotSettings virtual_robot;

  int num_joints() const { return static_cast<int>(joints.size()); }
  int num_positions() const;   ///< size of q
  int num_velocities() const;  ///< size of v and of efforts
  /// The joints with a motor, in order: an action has an entry for each.
  std::vector<int> driven() const;
  /// Of the driven joints, in order.
  Eigen::VectorXd effort_limits() const;
  /// The parameters' coordinates -> physical units, one value per parameter.
  Eigen::VectorXd ToPhysical(const Eigen::VectorXd& coordinates) const;
  /// Index of a parameter, -1 if there is none of that name.
  int FindParameter(const std::string& parameter) const;
};

/// Reads a robot from a folder (its robot.toml) or from a TOML file.
/// @throws ConfigError naming file, line and field for anything missing, unknown, out of range or
/// inconsistent between URDF and TOML.
RobotDescription LoadRobot(const std::string& folder_or_file);

}  // namespace plumb
