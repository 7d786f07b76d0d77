#pragma once

#include <vector>

#include "common/config.h"
#include "robot/description.h"

namespace plumb {

/// Tables of robot.toml that need little of the robot. All throw ConfigError.
DriverSettings ReadDriver(Config config, const std::vector<JointDescription>& joints);
/// @param robot with links, joints, sensors and simulation.
EstimatorSettings ReadEstimator(Config config, const RobotDescription& robot);
SimulationSettings ReadSimulation(Config config, double period);
ControllerSettings ReadController(Config config);
CalibrationSettings ReadCalibration(Config config);
TrainingSettings ReadTraining(Config config);
/// @param robot with joints and parameters.
VirtualRobotSettings ReadVirtualRobot(Config config, const RobotDescription& robot);

}  // namespace plumb
