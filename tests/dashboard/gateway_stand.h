#pragma once

#include <cstdint>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "common/message_bytes.h"
#include "dashboard/gateway.h"
#include "plumb/driver_status_t.hpp"
#include "plumb/training_status_t.hpp"
#include "tests/dashboard/looker.h"

namespace plumb {

inline constexpr int64_t kUtime = 1'700'000'000'000'000;  // [us]

/// Of the source tree.
inline std::string Source() {
  const char* const source = std::getenv("PLUMBLINE_SOURCE");
  return source ? source : ".";
}

inline const RobotDescription& Pendulum() {
  static const RobotDescription robot = LoadRobot(Source() + "/robots/pendulum");
  return robot;
}

/// A gateway, what it asks the driver for, and its time.
struct Stand {
  explicit Stand(Gateway::Setting setting = {})
      : gateway(Pendulum(), setting,
                [this](const driver_request_t& request) { requests.push_back(request); }) {
    gateway.Join(looker.viewer);
    looker.Take();
  }
  template <class Message>
  void Hear(const std::string& channel, const Message& message, bool believed = true) {
    gateway.OnMessage(channel, Encode(message), believed, moment.now, moment);
  }
  void Listen(const std::string& topic) {
    gateway.OnText(looker.viewer, looker.Subscription(topic));
  }
  void Call(uint8_t service) { gateway.OnBinary(looker.viewer, Looker::CallOf(service), moment); }
  void Pass(int64_t us) {
    moment.now += us, moment.utime += us, moment.date += us;
    gateway.Tick(moment);
  }
  /// ok and text of the newest answer.
  std::string Answer() {
    looker.Take();
    if (looker.answers.empty()) return "none yet";
    const nlohmann::json& answer = looker.answers.back();
    return (answer["ok"] == true ? "yes: " : "no: ") + answer["text"].get<std::string>();
  }

  std::vector<driver_request_t> requests;
  Gateway gateway;
  Looker looker;
  Gateway::Moment moment{1'000'000, kUtime, kUtime};
};

inline robot_state_t State(int64_t sequence, double q = 0.1) {
  robot_state_t state{};
  state.utime = kUtime + 5000 * sequence;
  state.sequence = sequence;
  state.num_positions = state.num_velocities = 1;
  state.q = {q};
  state.v = {0};
  state.q_sd = state.v_sd = {0.001};
  state.effort = {0};
  state.valid = true;
  return state;
}

inline training_status_t Training(int iteration, int update) {
  training_status_t status{};
  status.utime = kUtime + update;
  status.iteration = iteration;
  status.update = update;
  return status;
}

inline driver_status_t Driver(int8_t state, int64_t answered = 0, const std::string& reason = "") {
  driver_status_t status{};
  status.utime = kUtime;
  status.state = state;
  status.answered = answered;
  status.reason = reason;
  return status;
}

enum : uint8_t { kEmergencyStop = 1, kArm, kDisarm, kConfirmPlaced };

}  // namespace plumb
