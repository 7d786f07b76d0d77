#pragma once

#include <cstdint>
#include <vector>

#include "estimator/state_observer.h"
#include "tests/estimator/simulated_readings.h"
#include "tests/sim/allocations.h"

namespace plumb {

/// Of the observer's steps through a recording.
inline int64_t AllocationsOf(const std::vector<SimulatedReadings::Sample>& recording,
                             StateObserver& observer) {
  int64_t counted = 0;
  for (const SimulatedReadings::Sample& sample : recording) {
    const int64_t before = Allocations();
    for (const imu_t& imu : sample.imus) observer.OnImu(imu);
    observer.OnJointState(sample.joints);
    counted += Allocations() - before;
  }
  return counted;
}

}  // namespace plumb
