#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>

#include "robot/description.h"
#include "trainer/rollout.h"

namespace plumb {

/// Makes simulations that are a virtual robot behind its bus (BusRobot): what trains in these, an
/// oracle, trains on the robot itself, through driver, observer and noise. Simulators that are
/// drawn for an episode change nothing: the robot is always the same one. Thread-safe.
/// @param truth,model,hidden,seed see BusRobot.
SimulationFactory SimulateBusRobot(const RobotDescription& truth, const RobotDescription& model,
                                   const Eigen::VectorXd& hidden, uint64_t seed);

}  // namespace plumb
