#include "cli/tune.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <stdexcept>
#include <variant>
#include <vector>

#include "calibrator/motion/log_reader.h"
#include "calibrator/motion/recorded_robot.h"
#include "common/progress_line.h"
#include "estimator/noise_tuning.h"
#include "plumb/place_robot_t.hpp"

namespace plumb {
namespace {

std::string Lines(const RobotDescription& robot, const TunedNoise& tuned, size_t i) {
  const NoiseDescription& noise = tuned.joints[i];
  std::string text = fmt::format(
      "# of [[joint]] \"{}\": deviance per reading {:.3f} instead of {:.3f}\n[joint.estimator]\n",
      robot.joints[i].name, tuned.after[i], tuned.before[i]);
  const auto add = [&](const char* key, double value) {
    if (std::isfinite(value)) text += fmt::format("{} = {:.3g}\n", key, value);
  };
  add("position_sd", noise.position_sd);
  add("velocity_sd", noise.velocity_sd);
  add("jerk", noise.jerk);
  add("effort_step", noise.effort_step);
  if (noise.ground_impact > 0) add("ground_impact", noise.ground_impact);
  if (noise.stop_impact > 0) add("stop_impact", noise.stop_impact);
  add("coupling", noise.coupling);
  add("delay", noise.delay);
  return text;
}

using Message = std::variant<joint_state_t, imu_t, place_robot_t>;

// What of a log an observer is told, in the file's order.
std::vector<Message> ReadMessages(const std::string& log) {
  std::vector<Message> messages;
  int64_t undecodable = 0;
  const auto keep = [&](auto message, const void* data, int size) {
    if (Decodes(data, size, message))
      messages.push_back(std::move(message));
    else
      ++undecodable;
  };
  const LogEnd end =
      ReadLog(log, [&](const std::string& channel, const void* data, int size, int64_t) {
        if (channel == "JOINT_STATE") keep(joint_state_t{}, data, size);
        if (channel == "IMU") keep(imu_t{}, data, size);
        if (channel == "PLACE_ROBOT") keep(place_robot_t{}, data, size);
        return true;
      });
  if (std::ranges::none_of(messages, [](const Message& message) {
        return std::holds_alternative<joint_state_t>(message);
      })) {
    throw std::runtime_error(fmt::format("{}: has no JOINT_STATE ({} undecodable){}", log,
                                         undecodable, end.cut_off ? "; it is cut off" : ""));
  }
  if (end.cut_off) spdlog::warn("{}: its last message is cut off", log);
  return messages;
}

void Play(const std::vector<Message>& messages, StateObserver& observer) {
  for (const Message& message : messages) {
    if (const auto* imu = std::get_if<imu_t>(&message))
      observer.OnImu(*imu);
    else if (const auto* measured = std::get_if<joint_state_t>(&message))
      observer.OnJointState(*measured);
    else
      observer.Place();
  }
}

}  // namespace

int TuneEstimator(const std::string& robot_path, const std::string& log) {
  const RobotDescription robot = LoadRobot(robot_path);
  for (const std::string& warning : CheckRecordedRobot(log, robot))
    spdlog::warn("{}: {}", log, warning);
  const std::vector<Message> messages = ReadMessages(log);
  ProgressLine line;
  int played = 0;
  const TunedNoise tuned = TuneNoise(robot, [&](StateObserver& observer) {
    line.Show("playing the log with other noise", static_cast<double>(played++) / kMaxPlays);
    Play(messages, observer);
  });
  const StateObserver observer(robot);
  for (size_t i = 0; i < tuned.joints.size(); ++i) {
    if (!observer.of_base(static_cast<int>(i))) std::cout << Lines(robot, tuned, i) << '\n';
  }
  return 0;
}

}  // namespace plumb
