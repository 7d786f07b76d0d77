#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "common/identity.h"
#include "common/message_bytes.h"
#include "plumb/joint_command_t.hpp"

namespace plumb {

// Messages of the channel JOINT_COMMAND, for tests of who is believed.

using Bytes = std::vector<uint8_t>;

inline constexpr char kChannel[] = "JOINT_COMMAND";
inline constexpr int64_t kNow = 1'700'000'000'000'000;  // [us]

inline Bytes Encoded(double effort = 0.5) {
  joint_command_t command{};
  command.utime = kNow;
  command.num_joints = 1;
  command.effort = {effort};
  command.position = command.velocity = command.kp = command.kd = {0};
  return Encode(command);
}

inline Bytes Say(Identity& who, std::string_view channel = kChannel) {
  Bytes bytes = Encoded();
  bytes.resize(bytes.size() + kSealSize);
  who.Seal(channel, bytes);
  return bytes;
}

/// Why it is not believed; empty = it is.
inline std::string Heard(ChannelJudge& judge, const Identity& me, const Bytes& bytes) {
  return std::string(judge.Hear(me, kChannel, bytes).refusal);
}

}  // namespace plumb
