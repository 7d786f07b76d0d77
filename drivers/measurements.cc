#include "drivers/measurements.h"

#include <algorithm>
#include <limits>

namespace plumb {

// 0.6 and not 0.5: two drives whose clocks are half a period apart must still find each other.
Measurements::Measurements(int num_joints, int64_t period)
    : tolerance_(period * 6 / 10), joints_(static_cast<size_t>(num_joints), Joint(period)) {}

void Measurements::Joint::Pop() {
  head = (head + 1) % kCapacity;
  --count;
  --regular;
}

void Measurements::Joint::Regularise() {
  std::array<int64_t, kCapacity> arrivals, times;
  const size_t fresh = count - regular;
  for (size_t i = 0; i < fresh; ++i) arrivals[i] = At(regular + i).time;
  const size_t timed = sync.Regularise(std::span(arrivals).first(fresh), std::span(times).first(fresh));
  for (size_t i = 0; i < timed; ++i) At(regular + i).time = times[i];
  regular += timed;
}

void Measurements::Add(int joint, const JointMeasurement& measurement, int64_t arrival) noexcept {
  Joint& queue = joints_[static_cast<size_t>(joint)];
  if (queue.count == kCapacity) {
    // Should the others be silent, the time of this joint must go on nevertheless.
    queue.Regularise();
    queue.Pop();
    ++dropped_;
  }
  queue.At(queue.count++) = {arrival, measurement};
}

int64_t Measurements::lost() const noexcept {
  int64_t lost = dropped_;
  for (const Joint& joint : joints_) lost += joint.sync.lost() + joint.sync.resets();
  return lost;
}

bool Measurements::Next(int64_t& utime, std::span<JointMeasurement> measurements) noexcept {
  for (Joint& joint : joints_) {
    joint.Regularise();
    // The clock was set back in between: the others' new samples would wait for ever for this old one.
    while (joint.regular > 1 && joint.At(1).time < joint.At(0).time) {
      joint.Pop();
      ++dropped_;
    }
  }
  while (std::ranges::all_of(joints_, [](const Joint& joint) { return joint.regular > 0; })) {
    int64_t newest = std::numeric_limits<int64_t>::min();
    for (Joint& joint : joints_) newest = std::max(newest, joint.At(0).time);
    bool complete = true;
    for (Joint& joint : joints_) {
      if (newest - joint.At(0).time <= tolerance_) continue;
      joint.Pop();
      ++dropped_;
      complete = false;
    }
    if (!complete) continue;
    utime = newest;
    for (size_t i = 0; i < joints_.size(); ++i) {
      measurements[i] = joints_[i].At(0).measurement;
      joints_[i].Pop();
    }
    return true;
  }
  return false;
}

}  // namespace plumb
