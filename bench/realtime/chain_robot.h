#pragma once

#include <filesystem>
#include <string>

#include "plumb/policy_t.hpp"
#include "robot/description.h"

namespace plumb {

// The robots whose chain is measured, and what they do meanwhile. Thread-safe, but for a folder
// that two threads would share.

enum class ChainRobot {
  kPendulum,  ///< robots/pendulum at 1 kHz, one drive
  kLegs,      ///< LegsOnStand: twelve drives on four buses at 500 Hz
};

/// Writes the robot's files. @param source folder with robots/. @return the robot's folder.
std::filesystem::path PrepareRobot(ChainRobot robot, const std::filesystem::path& source,
                                   const std::filesystem::path& folder);

/// URL of the bus with the first joint's drive, where we listen.
std::string ObservedBus();

/// The first joint's effort as a smooth function of how it moves: no two commands of a swing are
/// the same.
policy_t SwingingPolicy(const RobotDescription& robot);

}  // namespace plumb
