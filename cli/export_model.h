#pragma once

#include <cstdint>
#include <string>

namespace plumb {

/// The flags of `plumb export-model`.
struct ExportModelFlags {
  std::string robot;
  std::string posterior;                  ///< posterior.json; empty = the prior
  std::string urdf, mjcf, randomisation;  ///< files; empty = none
  int samples = 100;                      ///< of the randomisation table
  uint64_t seed = 1;                      ///< of its random numbers
};

/// `plumb export-model`: what is known of a robot, for other simulators: its URDF and its MJCF with
/// the means of the parameters, and a table of samples of them. @return exit status 0.
/// @throws std::invalid_argument or std::runtime_error, one line for people: robot, posterior,
/// files, nothing to write. Thread-safe but for the files.
int ExportModel(const ExportModelFlags& flags);

}  // namespace plumb
