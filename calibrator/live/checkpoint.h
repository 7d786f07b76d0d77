#pragma once

#include <filesystem>
#include <optional>

#include "calibrator/live/simopt.h"

namespace plumb {

/// Keeps a SimOpt state in a folder: `calibration.checkpoint` (small, after every update) and one
/// `rollout_<n>.checkpoint` each, JSON with a checksum (common/checked_file.h). Files are replaced
/// atomically; numbers are written so that they read back to the same bits.
/// Not thread-safe, and a folder belongs to one process at a time.
class CalibrationCheckpoint {
 public:
  /// Creates the folder. @throws std::runtime_error if it cannot.
  CalibrationCheckpoint(std::filesystem::path folder, const RobotDescription& robot, uint64_t seed);

  void Save(const SimOpt::State& state);
  /// @return empty if there is none. @throws std::runtime_error naming the file if it is damaged or
  /// is another robot's or seed's.
  std::optional<SimOpt::State> Load() const;

 private:
  std::filesystem::path folder_;
  RobotDescription robot_;
  uint64_t seed_;
  size_t saved_rollouts_ = 0;
};

/// The roll-outs of a checkpoint folder's calibration, in order; none if there is no checkpoint.
/// @throws std::runtime_error naming the file if one is damaged, missing or another robot's.
std::vector<Rollout> LoadRollouts(const std::filesystem::path& folder,
                                  const RobotDescription& robot);

}  // namespace plumb
