#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "plumb/controller_status_t.hpp"
#include "plumb/driver_status_t.hpp"

namespace plumb {

/// When the driver of a run is to be armed again: a virtual robot's after a fault, though not for
/// ever. What a person has stopped, and a real robot in any case, only a person starts. Pure logic.
/// Not thread-safe.
class Rearming {
 public:
  /// Faults without an episode in between after which a run ends.
  static constexpr int kMost = 20;

  /// @param command for a person to type. @param now [us], as below.
  Rearming(bool real, std::string command, int64_t now)
      : real_(real), command_(std::move(command)), last_request_(now) {}

  struct Advice {
    std::vector<std::string> lines;  ///< for people to read
    bool arm = false;                ///< ask the driver for it
    bool give_up = false;
  };
  Advice Next(const driver_status_t& driver, const controller_status_t& controller, int64_t now);
  /// Faults so far, but a real robot's.
  int count() const { return count_; }

 private:
  const bool real_;
  const std::string command_;
  int64_t last_request_;
  bool stopped_ = false, fault_seen_ = false;
  int count_ = 0, since_episode_ = 0;
  int32_t episodes_ = 0;  // done with the policy in use
};

}  // namespace plumb
