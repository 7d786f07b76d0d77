#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "robot/description.h"

namespace plumb {

// The functions here share nothing: thread-safe.

/// Efforts to apply one after the other, whatever the robot does.
struct Excitation {
  std::string name;        ///< "multisine up to 2.5 Hz, 50 % effort"
  Eigen::MatrixXd action;  ///< control steps x driven joints, shares of the effort limits, -1 to 1
};

struct ExcitationSettings {
  int candidates = 61;      ///< at least 1
  double seconds = 10;      ///< > 0, of each
  bool one_by_one = false;  ///< each joint moves in its own part of the time, the others do not
  int draws = 3;            ///< simulators of the belief beside its mean
  /// share of a joint's range, and of its velocity limit, to keep away from its ends
  double margin = 0.05;
  uint64_t seed = 1;
};

/// The task's own random actions, then random steps, bang-bang, multisines, chirps and impulses, in
/// turn at several amplitudes and bandwidths, of all driven joints at once but differently, or one
/// by one. Equal seeds give equal excitations.
std::vector<Excitation> MakeExcitations(const RobotDescription& robot,
                                        const ExcitationSettings& settings);

}  // namespace plumb
