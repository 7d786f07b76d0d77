#include "calibrator/motion/recorded_robot.h"

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>

#include "calibrator/motion/lcm_log.h"
#include "common/config.h"
#include "tests/calibrator/fitted_log.h"
#include "tests/calibrator/motion/lcm_recording.h"
#include "tests/calibrator/synthetic.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

std::string Source(const std::string& file) {
  return std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/" + file;
}

/// A log, and what `plumb launch` puts beside it.
class RecordedLog {
 public:
  RecordedLog() {
    Recording r;
    r.Episode(100, 30, 20);
    r.States(211, 240);
    std::ofstream(path(), std::ios::binary) << r.bytes;
  }
  std::string path() const { return folder_ / "run.lcmlog"; }

  void Of(const std::string& folder, const std::string& toml) const {
    fs::create_directories(path() + ".d");
    fs::copy_file(Source(folder + "/robot.urdf"), path() + ".d/robot.urdf",
                  fs::copy_options::overwrite_existing);
    WriteToml(MergedToml(Source(folder + "/" + toml), "robot", "urdf", "robot.urdf"));
  }
  void WriteToml(const std::string& text) const { std::ofstream(path() + ".d/robot.toml") << text; }

 private:
  TemporaryFolder folder_;
};

TEST_CASE("a log of another robot with as many joints is refused, by what is beside it") {
  const RecordedLog log;
  log.Of("servo", "robot.toml");
  CHECK_THROWS_WITH(
      ReadLcmLog(log.path(), Pendulum()),
      log.path() + ": is a log of servo, not of pendulum: its joint 1 is shaft, not pivot, says " +
          log.path() +
          ".d/robot.toml; if it is the same robot under another name, move that file away");
  fs::remove(log.path() + ".d/robot.toml");
  CHECK(ReadLcmLog(log.path(), Pendulum()).warnings.empty());
}

TEST_CASE("a log of the same robot by another TOML file is read without a word") {
  const RecordedLog log;
  for (const char* toml : {"robot.toml", "gym.toml", "weak.toml", "worn.toml", "rmd.toml"}) {
    log.Of("pendulum", toml);
    INFO(toml);
    CHECK(ReadLcmLog(log.path(), Pendulum()).warnings.empty());
  }
  for (const char* toml : {"robot.toml", "gym.toml", "mujoco.toml", "free.toml", "moteus.toml"}) {
    log.Of("hopper", toml);
    INFO(toml);
    CHECK(CheckRecordedRobot(log.path(), Robot("hopper")).empty());
  }
  log.Of("quadruped", "hung.toml");  // it has no base, and another name
  CHECK(CheckRecordedRobot(log.path(), Robot("quadruped/hung.toml")).empty());
  RobotDescription renamed = Robot("quadruped/hung.toml");
  renamed.name = "mine";
  CHECK(CheckRecordedRobot(log.path(), renamed).empty());
}

TEST_CASE("a robot whose joints have other names since is read with a warning") {
  const RecordedLog log;
  log.Of("pendulum", "robot.toml");
  RobotDescription robot = Pendulum();
  robot.joints[0].name = "hinge";
  CHECK(ReadLcmLog(log.path(), robot).warnings ==
        std::vector<std::string>{"its robot is not as " + robot.file +
                                 " has it: its joint 1 is pivot, not hinge, says " + log.path() +
                                 ".d/robot.toml"});
}

TEST_CASE("a description that cannot be read says nothing") {
  const RecordedLog log;
  log.Of("servo", "robot.toml");
  log.WriteToml("[robot]\nname = \"of another version\"\n");
  CHECK(ReadLcmLog(log.path(), Pendulum()).warnings.empty());
}

}  // namespace
}  // namespace plumb
