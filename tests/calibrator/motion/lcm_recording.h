#pragma once

#include <endian.h>

#include <cmath>
#include <cstdint>
#include <string>

#include "plumb/controller_status_t.hpp"
#include "plumb/joint_command_t.hpp"
#include "plumb/robot_state_t.hpp"

namespace plumb {

/// An LCM log in memory: a robot with states every 5 ms, numbered from 0, and commands every 50 ms.
class Recording {
 public:
  template <class Message>
  void Add(const std::string& channel, const Message& message) {
    std::string data(static_cast<size_t>(message.getEncodedSize()), '\0');
    message.encode(data.data(), 0, static_cast<int>(data.size()));
    AddBytes(channel, data);
  }
  void AddBytes(const std::string& channel, const std::string& data) {
    Append(htobe32(0xeda1da01));
    Append(htobe64(static_cast<uint64_t>(events_++)));
    Append(htobe64(uint64_t{1'000'000}));
    Append(htobe32(static_cast<uint32_t>(channel.size())));
    Append(htobe32(static_cast<uint32_t>(data.size())));
    bytes += channel + data;
  }

  void State(int64_t sequence, int joints = 1) {
    robot_state_t s{};
    s.sequence = sequence;
    s.utime = start + 5000 * (sequence % 1'000'000);
    s.num_positions = s.num_velocities = joints;
    const auto n = static_cast<size_t>(joints);
    s.q.assign(n, 1e-3 * static_cast<double>(sequence));
    s.v.assign(n, 0.2);
    s.q_sd.assign(n, 1e-4);
    s.v_sd.assign(n, 1e-2);
    s.effort.assign(n, 0.5);
    s.valid = 1;
    s.model_based = model_based;
    Add("ROBOT_STATE_SMOOTHED", s);
  }
  void Command(int64_t state, int64_t episode, int step) {
    joint_command_t c{};
    c.state_sequence = state;
    c.episode = episode;
    c.step = step;
    c.num_joints = 1;
    c.effort = {1};
    c.position = c.velocity = c.kp = c.kd = {NAN};
    Add("JOINT_COMMAND", c);
  }
  void Status(int64_t episode, int64_t last_state) {
    controller_status_t s{};
    s.phase = controller_status_t::RUNNING;
    s.num_episodes = 1;
    s.steps = {20}, s.late_rate = {0}, s.fell = {0};
    s.episode = {episode};
    s.first_state_sequence = {0};
    s.last_state_sequence = {last_state};
    s.returns = {0};
    Add("CONTROLLER_STATUS", s);
  }
  /// An episode of so many steps from a state on, states coming 20 later than the commands that
  /// answer them, and the command of no episode after it.
  void Episode(int64_t id, int64_t first_state, int steps) {
    for (int64_t i = 0; i <= 10 * steps; ++i) {
      if (i % 10 == 0) {
        Command(first_state + i, i < 10 * steps ? id : -1,
                i < 10 * steps ? static_cast<int>(i / 10) : -1);
      }
      if (first_state + i >= 20) State(first_state + i - 20);
    }
  }
  void States(int64_t from, int64_t to) {
    for (int64_t i = from; i <= to; ++i) State(i);
  }

  std::string bytes;
  int64_t start = 7'000'000;
  bool model_based = false;  // states from now on

 private:
  template <class T>
  void Append(T big_endian) {
    bytes.append(reinterpret_cast<const char*>(&big_endian), sizeof big_endian);
  }
  int64_t events_ = 0;
};

}  // namespace plumb
