#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "robot/buses.h"
#include "robot/joints.h"
#include "robot/parameters.h"
#include "robot/sensors.h"
#include "robot/settings/calibration.h"
#include "robot/settings/controller.h"
#include "robot/settings/driver.h"
#include "robot/settings/estimator.h"
#include "robot/settings/simulation.h"
#include "robot/settings/task.h"
#include "robot/settings/training.h"
#include "robot/settings/virtual_robot.h"
#include "robot/urdf/tree.h"

namespace plumb {

/// Everything there is to know about a robot: robot.urdf and robot.toml, validated. links[0] is the
/// fixed base; joints are in order of URDF depth-first traversal and joint i moves link i + 1. The
/// generalised coordinates q, v are the joints' one after the other: one each, but for spherical
/// joints.
struct RobotDescription {
  std::string file;  ///< the TOML file
  /// of the contents of all files (FNV-1a): a checkpoint of other contents is another's
  uint64_t fingerprint = 0;
  std::vector<std::string> meshes;  ///< files of collision meshes
  std::string name;
  std::vector<LinkDescription> links;
  std::vector<JointDescription> joints;
  std::vector<BusDescription> buses = std::vector<BusDescription>(1);  ///< one or more
  std::vector<SensorDescription> sensors;
  DriverSettings driver;
  EstimatorSettings estimator;
  SimulationSettings simulation;
  std::vector<ParameterDescription> parameters;  ///< the uncertain ones
  std::vector<FrozenParameter> frozen;           ///< the others
  std::vector<std::string> warnings;  ///< of parts without effect, e.g. a collision cylinder
  TaskSettings task;
  ControllerSettings controller;
  CalibrationSettings calibration;
  TrainingSettings training;
  VirtualRobotSettings virtual_robot;

  int num_joints() const { return static_cast<int>(joints.size()); }
  int num_positions() const { return position_of(num_joints()); }   ///< size of q
  int num_velocities() const { return velocity_of(num_joints()); }  ///< size of v and of efforts
  int position_of(int joint) const;                                 ///< its first entry in q
  int velocity_of(int joint) const;                                 ///< its first entry in v
  /// The joints with a motor, in order: an action has an entry for each.
  std::vector<int> driven() const;
  /// Of the driven joints, in order.
  Eigen::VectorXd effort_limits() const;
  /// The parameters' coordinates -> physical units, one value per parameter.
  Eigen::VectorXd ToPhysical(const Eigen::VectorXd& coordinates) const;
  /// Index of a parameter, -1 if there is none of that name.
  int FindParameter(const std::string& parameter) const;
  /// The name of the parameter, uncertain or frozen, that gives what is at a path: the path itself,
  /// else a name that covers it; empty if there is none.
  std::string ParameterOf(const std::string& path) const;
  bool IsUncertain(const std::string& path) const { return FindParameter(ParameterOf(path)) >= 0; }
};

/// Reads a robot from a folder (its robot.toml) or from a TOML file. A relative path that is not
/// there is one of the robots that are installed with the program, share/plumbline/robots/hopper
/// as robots/hopper; `warnings` says so.
/// @throws ConfigError naming file, line and field for anything missing, unknown, out of range or
/// inconsistent between URDF and TOML. Thread-safe but for the files.
RobotDescription LoadRobot(const std::string& folder_or_file);

}  // namespace plumb
