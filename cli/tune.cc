#include "cli/tune.h"

#include <fmt/format.h>

#include <cmath>
#include <iostream>
#include <stdexcept>
#include <variant>
#include <vector>

#include "calibrator/motion/log_reader.h"
#include "common/progress_line.h"
#include "estimator/noise_tuning.h"

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

}  // namespace

int TuneEstimator(const std::string& robot_path, const std::string& log) {
  const RobotDescription robot = LoadRobot(robot_path);
  std::vector<std::variant<joint_state_t, imu_t>> messages;
  int64_t undecodable = 0;
  const auto keep = [&](auto message, const void* data, int size) {
    if (Decodes(data, size, message))
      messages.push_back(std::move(message));
    else
      ++undecodable;
  };
  ReadLog(log, [&](const std::string& channel, const void* data, int size, int64_t) {
    if (channel == "JOINT_STATE") keep(joint_state_t{}, data, size);
    if (channel == "IMU") keep(imu_t{}, data, size);
    return true;
  });
  if (messages.empty()) {
    throw std::runtime_error(
        fmt::format("{}: has no JOINT_STATE ({} undecodable)", log, undecodable));
  }
  ProgressLine line;
  int played = 0;
  const TunedNoise tuned = TuneNoise(robot, [&](StateObserver& observer) {
    line.Show("playing the log with other noise", static_cast<double>(played++) / kMaxPlays);
    for (const auto& message : messages) {
      if (const auto* imu = std::get_if<imu_t>(&message))
        observer.OnImu(*imu);
      else
        observer.OnJointState(std::get<joint_state_t>(message));
    }
  });
  const StateObserver observer(robot);
  for (size_t i = 0; i < tuned.joints.size(); ++i) {
    if (!observer.of_base(static_cast<int>(i))) std::cout << Lines(robot, tuned, i) << '\n';
  }
  return 0;
}

}  // namespace plumb
