#pragma once

#include <vector>

#include "common/config.h"
#include "robot/description.h"

namespace plumb {

/// Tables of robot.toml that need nothing of the robot. All throw ConfigError.
DriverSettings ReadDriver(Config config, const std::vector<JointDescription>& joints);
EstimatorSettings ReadEstimator(Config config);
SimulationSettings ReadSimulation(Config config, double period);
ControllerSettings ReadController(Config config);
CalibrationSettings ReadCalibration(Config config);
TrainingSettings ReadTraining(Config config);
VirtualRobotSettings ReadVirtualRobot(Config config, const std::vector<ParameterDescription>& parameters);

}  // namespace plumb
