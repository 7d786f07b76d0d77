#pragma once

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "cli/child.h"
#include "tests/process/stage.h"

namespace plumb {

/// `plumb launch` of a robot, watched from outside by a stage in real time.
inline Child Launch(Stage& stage, std::vector<std::string> flags,
                    const std::string& output = "run") {
  std::vector<std::string> arguments{
      Stage::Binary("plumb"), "launch",   stage.robot_folder,   "--lcm-url", stage.lcm_url, "--bus",
      stage.bus_url,          "--output", stage.folder / output};
  arguments.insert(arguments.end(), flags.begin(), flags.end());
  return Child("plumb", arguments, stage.folder / (output + ".log"));
}

inline constexpr double kLong = 1200;  // [s] of real time: whoever is as late as that hangs

/// Waits for a run's end. @return what it has printed.
inline std::string Finish(Stage& stage, Child& launch) {
  stage.WaitUntil([&] { return !launch.running(); }, kLong);
  INFO(launch.Tail(30));
  REQUIRE_FALSE(launch.running());
  CHECK_FALSE(launch.failed());
  return launch.Tail(100);
}

/// The stage's robot becomes one that learns so little that a run takes seconds.
/// @param kind of it, a file in its folder.
inline void LearnLittle(Stage& stage, int updates = 3, int updates_again = 1,
                        const std::string& kind = "robot.toml") {
  const std::filesystem::path file = stage.folder / "robot.toml";
  std::ofstream(file) << fmt::format(
      "extends = \"{0}/{1}\"\n[robot]\nurdf = \"{0}/robot.urdf\"\n[training]\nupdates = {2}\n"
      "updates_again = {3}\n",
      stage.robot_folder, kind, updates, updates_again);
  stage.robot_folder = file;
}

/// The bytes of the last frame with an id in a log of candump's form: the whole run's, while a
/// witness of the bus may be too slow to hear the end. Empty if there is none.
inline std::string LastFrame(const std::filesystem::path& can_log, const std::string& id) {
  const std::string frames = Read(can_log), head = " " + id + "#";
  const size_t last = frames.rfind(head);
  if (last == std::string::npos) return "";
  const size_t begin = last + head.size();
  return frames.substr(begin, frames.find_first_of(" \n", begin) - begin);
}

/// How many processes have the stage's LCM URL in their command line.
inline int Left(const Stage& stage) {
  int left = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    if (Read(entry.path() / "cmdline").find(stage.lcm_url) != std::string::npos) ++left;
  }
  return left;
}

}  // namespace plumb
