#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "chaos/chronicle.h"
#include "drivers/can/frame.h"
#include "plumb/lockstep_post_t.hpp"
#include "robot/description.h"

namespace plumb {

/// Sees of the torques that the driver puts on the bus that each
/// - is finite, within its joint's limit, and what a command that the driver has been told within
///   `expiry` wants, or less (invariant 1);
/// - has nothing against it that docs/safety.md ends a torque for, and for longer than it says (2);
/// and of the drives that none runs on without the driver for longer than its watchdog (2). Knows
/// CANSimple's frames by itself, and of the driver nothing. Not thread-safe.
class TorqueWitness {
 public:
  /// @throws std::invalid_argument if a motor has another protocol, or it stops otherwise than by
  /// zero torque.
  TorqueWitness(const RobotDescription& robot, Chronicle& chronicle);

  /// Times are the run's [us].
  void OnStart(const std::string& name);
  void OnStall(const std::string& name, int64_t from, int64_t until);
  /// Dates differ from now on: how old a command is cannot be told.
  void OnClockSet() { dates_agree_ = false; }
  void OnSaid(int64_t time, const lockstep_post_t& post, const std::string& speaker);
  /// @param genuine of a message: its signature is right.
  void OnHeard(const lockstep_post_t& post, const std::string& speaker, const std::string& listener,
               bool genuine);

 private:
  struct Heartbeat {
    int64_t arrival;
    bool running;
  };
  struct Node {
    size_t joint;  // of the robot
    double limit;  // [Nm] of the motor's torque
    double per_effort;
    std::deque<int64_t> estimates;  // arrivals
    std::deque<Heartbeat> heartbeats;
    int64_t fed = 0;           // arrival of the last frame that the drive was sent
    bool told_to_run = false;  // by the driver, and not to stop since
  };
  struct Command {
    int64_t arrival, utime, expiry;
    std::vector<double> effort;
    bool plain;  // an effort and nothing else
  };

  void OnTorque(int64_t time, Node& node, double torque);
  void OnDriverState(int64_t time, bool active);
  void OnDriveHeartbeat(int64_t time, const Node& node, const Frame& frame);
  bool Wanted(int64_t time, const Node& node, double torque) const;
  std::string Against(int64_t time, const Node& node) const;
  void OnDriverHears(const Frame& frame, int64_t arrival);
  int64_t When(const std::string& listener, int64_t arrival) const;
  Node* Find(uint32_t id);

  const RobotDescription& robot_;
  Chronicle& chronicle_;
  const int64_t cycle_, expiry_, stale_after_, heartbeat_timeout_, watchdog_;
  std::map<uint32_t, Node> nodes_;
  std::deque<Command> commands_;      // that the driver has been told
  std::deque<int64_t> stops_, arms_;  // likewise, arrivals
  bool armed_ = false;                // as the driver says
  bool dates_agree_ = true;
  struct Stall {
    int64_t from, until;
  };
  std::map<std::string, std::vector<Stall>> stalls_;
};

}  // namespace plumb
