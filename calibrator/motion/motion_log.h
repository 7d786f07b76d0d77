#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "calibrator/motion/log_reader.h"
#include "plumb/controller_status_t.hpp"
#include "plumb/joint_command_t.hpp"
#include "plumb/robot_state_t.hpp"

namespace plumb {

// Thread-safe, but for a receiver that two threads would share; the caller's thread calls it.

struct MotionCounts {
  int64_t events = 0;       ///< of all channels
  int64_t messages = 0;     ///< of the three
  int64_t undecodable = 0;  ///< of the three, left out
  bool cut_off = false;     ///< see LogEnd
};

/// Hands what an LCM log tells of a robot's motion to a receiver, in the file's order, as a live
/// run would: ROBOT_STATE_SMOOTHED to OnState, JOINT_COMMAND to OnCommand and CONTROLLER_STATUS to
/// OnControllerStatus.
/// @param go_on asked after every event of any channel; false stops.
/// @throws std::runtime_error, see ReadLog; and what the receiver and go_on throw.
template <class Receiver>
MotionCounts ReadMotion(const std::string& file, Receiver& receiver,
                        const std::function<bool()>& go_on) {
  robot_state_t state{};
  joint_command_t command{};
  controller_status_t status{};
  MotionCounts counts;
  const auto decoded = [&](auto& message, const void* data, int size) {
    ++counts.messages;
    if (Decodes(data, size, message)) return true;
    ++counts.undecodable;
    return false;
  };
  const LogEnd end =
      ReadLog(file, [&](const std::string& channel, const void* data, int size, int64_t) {
        if (channel == "ROBOT_STATE_SMOOTHED") {
          if (decoded(state, data, size)) receiver.OnState(state);
        } else if (channel == "JOINT_COMMAND") {
          if (decoded(command, data, size)) receiver.OnCommand(command);
        } else if (channel == "CONTROLLER_STATUS") {
          if (decoded(status, data, size)) receiver.OnControllerStatus(status);
        }
        return go_on();
      });
  counts.events = end.events, counts.cut_off = end.cut_off;
  return counts;
}

}  // namespace plumb
