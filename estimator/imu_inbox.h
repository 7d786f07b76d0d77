#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

#include "plumb/imu_t.hpp"

namespace plumb {

/// Readings of one IMU that wait for the JOINT_STATE of their time, in order of their times,
/// whatever order they came in. Of a bounded number: what is more than that, or too late for the
/// smoother, is refused. Does not allocate. Not thread-safe.
class ImuInbox {
 public:
  static constexpr int64_t kLatest = 50'000;  ///< [us] of a reading before the newest state
  /// [us] after it: further ahead is a clock that was set
  static constexpr int64_t kAhead = 1'000'000;

  struct Reading {
    int64_t utime;
    std::array<double, 3> rate, force;
    std::array<double, 4> orientation;
    bool orientation_valid, rate_clipped, force_clipped;
  };
  enum class Verdict { kTaken, kReordered, kDuplicate, kRefused };

  /// @param state_utime of the newest state; 0: there is none yet.
  Verdict Put(const imu_t& imu, int64_t state_utime);
  /// The oldest that was measured until `utime`, out of the inbox; null if there is none. Valid
  /// until the next Put.
  const Reading* Take(int64_t utime);
  /// The clock was set: what waits is of another time.
  void Clear() {
    count_ = remembered_ = 0;
    newest_ = 0;
  }

 private:
  static constexpr size_t kRoom = 32;

  std::array<Reading, kRoom> readings_;  // ordered, the newest first
  size_t count_ = 0;
  Reading taken_{};
  std::array<int64_t, kRoom> seen_{};  // ring of the last times
  size_t remembered_ = 0;
  int64_t newest_ = 0;
};

}  // namespace plumb
