#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>

#include "robot/description.h"

namespace plumb {

/// The robot's URDF with other values of its parameters: masses, centres of mass, inertias, the
/// origins of joints, and <dynamics>. It is the text of the original but for the numbers that
/// change, and a comment at its top with the values and their standard deviations. What URDF has no
/// place for (gravity, armature, delays, contact ...), or what robot.toml says instead of the URDF,
/// is in that comment as tables for robot.toml.
///
/// Links and joints that LoadRobot reads from it are those of Model::Describe(mean). Where fixed
/// joints weld several bodies with mass into one link that changes, the first of them carries all
/// of the mass. A link whose length changes takes its solids and meshes with it. Paths to meshes
/// stay as they are: the file belongs beside the original.
///
/// @param robot as LoadRobot read it; its files are read again.
/// @param mean,sd of its parameters, physical units. Frozen parameters have the values that they
/// are frozen at. @param residual whether the robot does what these cannot explain, and a residual
/// was learnt, which no URDF holds: the comment then says so.
/// @throws ConfigError naming the file if it is not what the robot was read from any more,
/// std::invalid_argument naming the parameter if its value is not physical. Thread-safe but for the
/// files.
std::string IdentifiedUrdf(const RobotDescription& robot, const Eigen::VectorXd& mean,
                           const Eigen::VectorXd& sd, bool residual = false);

/// The same into a file, atomically. @throws std::runtime_error too, naming the file, if it cannot
/// be written.
void WriteIdentifiedUrdf(const std::filesystem::path& file, const RobotDescription& robot,
                         const Eigen::VectorXd& mean, const Eigen::VectorXd& sd,
                         bool residual = false);

}  // namespace plumb
