#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

namespace plumb {

/// A rigid body. Shapes and frames as in URDF: the link frame is at the joint that moves it.
struct LinkDescription {
  std::string name;
  double mass = 0;                                             ///< [kg]
  Eigen::Vector3d center_of_mass = Eigen::Vector3d::Zero();    ///< [m], in the link frame
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();           ///< [kg m^2], about the centre of mass, link axes
};

/// How a joint's motor is reached.
struct MotorDescription {
  std::string protocol;  ///< file name in drivers/protocols/, e.g. "cansimple"
  int node = 0;          ///< CAN node id of the protocol
  double gear = 1;       ///< motor turns per joint turn (or per metre / 2 pi for a prismatic joint), > 0
  int sign = 1;          ///< +1 or -1
  double offset = 0;     ///< [rad] or [m] joint position at motor position 0
};

/// A moving joint, connecting links[parent] to the link of the same index + 1... see RobotDescription.
struct JointDescription {
  enum class Type { kRevolute, kContinuous, kPrismatic };
  std::string name;
  Type type = Type::kRevolute;
  int parent = 0;  ///< index into links
  int child = 0;   ///< index into links
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();              ///< [m], in the parent link's frame
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();        ///< joint frame's axes in the parent link's
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();               ///< unit vector, in the joint frame
  double lower = 0;           ///< [rad] or [m]; -infinity for a continuous joint
  double upper = 0;           ///< [rad] or [m]; +infinity for a continuous joint
  double effort_limit = 0;    ///< [Nm] or [N], > 0
  double velocity_limit = 0;  ///< [rad/s] or [m/s], > 0
  MotorDescription motor;
};

struct DriverSettings {  ///< all [s], scaled time
  double cycle, measurement, expiry, disarm_after, stale_after, heartbeat_timeout, start_guard;
};

struct EstimatorSettings {
  double position_sd;  ///< [rad]
  double velocity_sd;  ///< [rad/s]
  double jerk;         ///< [rad/s^3 sqrt(s)]
  double effort_step;  ///< [rad/s^2 per Nm]
  double timing_sd;    ///< [s]
  int lag;             ///< [measurements]
  double reset_after;  ///< [rad]
};

struct SimulationSettings {
  /// kSemiImplicit: v += h a(q, v); q += h v, as gym does. kLeapfrog: q += h/2 v; v += h a; q += h/2 v.
  enum class Integrator { kSemiImplicit, kLeapfrog };
  Integrator integrator;
  double substep;    ///< [s] upper bound; a step is divided evenly
  double latency;    ///< [s] in training: the previous action acts that long into a step
  double speed_clip; ///< [rad/s] velocities are clipped to this after each substep; infinity = no clip
  /// gym v0 moves the position with the speed before clipping it; false = with the clipped one.
  bool move_before_clip;
};

/// One uncertain simulator parameter, named by a path such as "gravity", "mass/pole", "length/pole".
struct ParameterDescription {
  enum class Coordinate { kLinear, kLog };
  std::string name;
  std::string unit;
  Coordinate coordinate;
  double mean;      ///< prior mean, physical units
  double variance;  ///< prior variance, physical units squared
  /// Prior in the coordinate. For kLog the Gaussian whose log-normal has that mean and variance:
  /// s^2 = ln(1 + variance/mean^2), m = ln(mean) - s^2/2.
  double coordinate_mean() const;
  double coordinate_variance() const;
  double ToPhysical(double coordinate_value) const;
  double ToCoordinate(double physical_value) const;
};

struct TaskSettings {
  std::string name;  ///< file name in sim/tasks/
  double period;     ///< [s] control period
  int steps;         ///< per episode
};

struct ControllerSettings {
  double state_timeout;    ///< [s]
  double place_tolerance;  ///< [rad]; times ten [rad/s]
};

struct CalibrationSettings {
  int samples, updates;
  double kl, min_temperature;
  std::vector<int> horizons;
};

struct TrainingSettings {
  int batch, updates, updates_again;
  std::vector<int> hidden;
  double gamma, lambda, kl, damping;
  int cg_iterations;
  double fisher_fraction;
  double critic_l2, critic_rate;
  int critic_epochs, critic_minibatch;
};

struct HiddenParameter {
  std::string name;  ///< one of the parameters
  double lower, upper;
};

struct VirtualRobotSettings {
  double watchdog;   ///< [s]
  double heartbeat;  ///< [s]
  int encoder_bits;  ///< per motor turn
  std::vector<HiddenParameter> hidden;
};

/// Everything there is to know about a robot: robot.urdf and robot.toml, validated.
/// links[0] is the fixed base; joints are in order of URDF depth-first traversal and are the generalised
/// coordinates, one each: q[i], v[i] belong to joints[i].
struct RobotDescription {
  std::string file;  ///< the TOML file
  uint64_t fingerprint = 0;  ///< of the contents of both files (FNV-1a): a checkpoint of other contents is another's
  std::string name;
  std::vector<LinkDescription> links;
  std::vector<JointDescription> joints;
  std::string bus_url;
  DriverSettings driver;
  EstimatorSettings estimator;
  SimulationSettings simulation;
  std::vector<ParameterDescription> parameters;
  TaskSettings task;
  ControllerSettings controller;
  CalibrationSettings calibration;
  TrainingSettings training;
  VirtualRobotSettings virtual_robot;

  int num_joints() const { return static_cast<int>(joints.size()); }
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
