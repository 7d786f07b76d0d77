#pragma once

#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>

#include "calibrator/motion/csv_log.h"
#include "calibrator/motion/log.h"
#include "common/random.h"
#include "robot/description.h"
#include "sim/environment.h"
#include "tests/calibrator/fitted_log.h"
#include "tests/temporary_file.h"

namespace plumb {

/// Gymnasium's pendulum: actions act at once.
inline RobotDescription GymPendulum() { return Robot("pendulum/gym.toml"); }

/// The log that a table with these contents is read as.
inline Log ReadTable(const std::string& contents, const RobotDescription& robot = GymPendulum()) {
  return ReadCsvLog(TemporaryFile(contents, ".csv").path(), robot);
}

/// The message of the exception that reading throws, without the file's name.
inline std::string Refusal(const std::string& contents,
                           const RobotDescription& robot = GymPendulum()) {
  const TemporaryFile file(contents, ".csv");
  try {
    ReadCsvLog(file.path(), robot);
  } catch (const std::runtime_error& error) {
    const std::string what = error.what();
    REQUIRE(what.find(file.path()) == 0);
    return what.substr(file.path().size());
  }
  return "nothing";
}

/// A table as `plumb sim --csv` writes it, of episodes under random actions.
inline std::string SimulatedTable(const RobotDescription& robot, int episodes, int steps) {
  Environment environment(robot);
  const Task& task = environment.task();
  std::string csv = "t";
  for (const char* kind : {",q/", ",v/"}) {
    for (const JointDescription& joint : robot.joints) csv += kind + joint.name;
  }
  for (const std::string& name : task.action_names()) csv += ",u/" + name;
  csv += ",reward,terminated,truncated\n";
  const auto append = [&](double x) { csv += fmt::format(",{:.17g}", x); };
  for (uint32_t episode = 0; episode < static_cast<uint32_t>(episodes); ++episode) {
    Random random(4, {episode});
    environment.Reset(random);
    for (int i = 0; i < steps; ++i) {
      csv += fmt::format("{:.17g}", i * robot.task.period);
      for (const double x : environment.q()) append(x);
      for (const double x : environment.v()) append(x);
      Eigen::VectorXf action(task.action_size());
      for (float& a : action) a = static_cast<float>(random.Uniform(-1.2, 1.2));
      const StepResult result = environment.Step(action);
      for (int k = 0; k < task.action_size(); ++k) {
        append(environment.effort()[task.action_indices()[static_cast<size_t>(k)]] /
               task.action_unit(k));
      }
      csv += fmt::format(",{},0,{:d}\n", result.reward, i + 1 == steps);
    }
  }
  return csv;
}

/// A table with next_ columns of a robot that is seen with noise, from `rows` of t; each row ends
/// near where the next begins.
inline std::string NextTable(double interval, int rows, double noise, bool random_starts = false) {
  Random random(3);
  std::string csv = "t,q/pivot,v/pivot,u/pivot,next_q/pivot,next_v/pivot\n";
  const auto q = [](int i) { return std::sin(0.3 * i); };
  const auto v = [](int i) { return 6 * std::cos(0.3 * i); };
  for (int i = 0; i < rows; ++i) {
    const double start_q = random_starts ? random.Uniform(-3, 3) : q(i),
                 start_v = random_starts ? random.Uniform(-8, 8) : v(i);
    const double end_q = random_starts ? start_q + 0.1 : q(i + 1) + noise * random.Normal();
    const double end_v = random_starts ? start_v - 0.1 : v(i + 1) + noise * random.Normal();
    csv += fmt::format("{},{},{},{},{},{}\n", i * interval, start_q, start_v, random.Uniform(-2, 2),
                       end_q, end_v);
  }
  return csv;
}

}  // namespace plumb
