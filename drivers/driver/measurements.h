#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "drivers/driver/timed_samples.h"

namespace plumb {

/// One joint's estimates, joint side, SI units.
struct JointMeasurement {
  double position = 0;
  double velocity = 0;
  double effort = 0;  ///< NaN = not reported
};

/// Puts the estimates of all joints together into complete measurements with regular times. A joint
/// whose frame was lost does not shift the others: estimates more than 0.6 of a period older than
/// the newest wait for nobody and are dropped. Does not allocate after construction. Not
/// thread-safe.
class Measurements {
 public:
  /// @param period [us] at which every drive sends its estimates.
  Measurements(int num_joints, int64_t period);

  /// @param arrival [us] utime at which the joint's estimate was received.
  void Add(int joint, const JointMeasurement& measurement, int64_t arrival) noexcept;

  /// Takes the next complete measurement; call until false, after everything that has arrived was
  /// added.
  /// @param utime its time: that of its latest estimate, freed of transport jitter, strictly
  /// increasing unless the clock was set back.
  /// @param measurements one for each joint.
  bool Next(int64_t& utime, std::span<JointMeasurement> measurements) noexcept;

  /// Estimates that found no partners, or no room, and those that never came; a gap or a step of
  /// the clock, after which it began anew, counts as one.
  int64_t lost() const noexcept;

 private:
  int64_t tolerance_;
  std::vector<TimedSamples<JointMeasurement>> joints_;
};

}  // namespace plumb
