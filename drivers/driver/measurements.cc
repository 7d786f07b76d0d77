#include "drivers/driver/measurements.h"

#include <algorithm>
#include <limits>

namespace plumb {

// 0.6 and not 0.5: two drives whose clocks are half a period apart must still find each other.
Measurements::Measurements(int num_joints, int64_t period)
    : tolerance_(period * 6 / 10),
      joints_(static_cast<size_t>(num_joints), TimedSamples<JointMeasurement>(period)) {}

void Measurements::Add(int joint, const JointMeasurement& measurement, int64_t arrival) noexcept {
  joints_[static_cast<size_t>(joint)].Add(measurement, arrival);
}

int64_t Measurements::lost() const noexcept {
  int64_t lost = 0;
  for (const auto& joint : joints_) lost += joint.lost();
  return lost;
}

bool Measurements::Next(int64_t& utime, std::span<JointMeasurement> measurements) noexcept {
  for (auto& joint : joints_) joint.Regularise();
  while (std::ranges::all_of(joints_, [](const auto& joint) { return joint.ready(); })) {
    int64_t newest = std::numeric_limits<int64_t>::min();
    for (const auto& joint : joints_) newest = std::max(newest, joint.time());
    bool complete = true;
    for (auto& joint : joints_) {
      if (newest - joint.time() <= tolerance_) continue;
      joint.Drop();
      complete = false;
    }
    if (!complete) continue;
    utime = newest;
    for (size_t i = 0; i < joints_.size(); ++i) {
      measurements[i] = joints_[i].front();
      joints_[i].Pop();
    }
    return true;
  }
  return false;
}

}  // namespace plumb
