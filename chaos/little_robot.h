#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace plumb {

// What a trial needs in its folder. Not thread-safe for one folder.

/// The robot, but that it learns so little that a run takes a second. @param original folder or
/// TOML file. @param run its folder. @return a TOML file, beside copies of all that it may refer
/// to.
/// @throws ConfigError, std::invalid_argument if the run's folder is within the robot's, or
/// std::filesystem::filesystem_error or std::runtime_error if they cannot be written.
std::string MakeLittleRobot(const std::string& original, const std::filesystem::path& run);

/// A key that follows from the seed: what is signed is the same in every run. @param number another
/// one is another key. @return the file. @throws std::runtime_error if it cannot be written.
std::string MakeKnownKey(const std::filesystem::path& file, uint64_t seed, uint32_t number);

}  // namespace plumb
