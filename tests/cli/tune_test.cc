// `plumb estimate tune`, run as a person would, and what it prints put where it says.
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <lcm/lcm-cpp.hpp>
#include <string>
#include <vector>

#include "plumb/place_robot_t.hpp"
#include "records/record_folder.h"
#include "tests/cli/shell.h"
#include "tests/estimator/observer_errors.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

// @param placed so many samples after one another the robot is placed.
std::string WriteLog(const TemporaryFolder& folder,
                     const std::vector<SimulatedReadings::Sample>& samples, size_t placed = 0) {
  const std::string file = folder / "run.lcmlog";
  lcm::LogFile log(file, "w");
  REQUIRE(log.good());
  const auto write = [&](const std::string& channel, const auto& message) {
    std::vector<char> bytes(static_cast<size_t>(message.getEncodedSize()));
    message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
    lcm::LogEvent event{};
    event.timestamp = message.utime;
    event.channel = channel;
    event.datalen = static_cast<int32_t>(bytes.size());
    event.data = bytes.data();
    REQUIRE(log.writeEvent(&event) == 0);
  };
  for (size_t i = 0; i < samples.size(); ++i) {
    place_robot_t place{};
    place.utime = samples[i].joints.utime;
    if (placed > 0 && i % placed == 0) write("PLACE_ROBOT", place);
    for (const imu_t& imu : samples[i].imus) write("IMU", imu);
    write("JOINT_STATE", samples[i].joints);
  }
  return file;
}

double Deviance(const RobotDescription& robot,
                const std::vector<SimulatedReadings::Sample>& samples) {
  StateObserver observer(robot);
  Play({samples}, observer);
  return observer.deviance(0) / static_cast<double>(observer.readings(0));
}

TEST_CASE(
    "plumb estimate tune prints settings under which another motion's readings are likelier") {
  const TemporaryFolder folder;
  const RobotDescription shipped = LoadRobot(Robot("pendulum"));
  const std::string log = WriteLog(folder, Swing(shipped, 1));
  const Outcome outcome = Shell(Plumb() + "estimate tune " + Robot("pendulum") + " --log " + log);
  INFO(outcome.text);
  REQUIRE(outcome.status == 0);
  const size_t lines = outcome.text.find("[joint.estimator]");
  REQUIRE(lines != std::string::npos);
  CHECK(outcome.text.find("of [[joint]] \"pivot\": deviance per reading") != std::string::npos);

  fs::copy(Robot("pendulum"), folder / "robot");
  const std::string toml = folder / "robot/robot.toml";
  std::string text = Read(toml);
  const size_t joint = text.find("[[joint]]"), next = text.find("\n[", text.find("name", joint));
  REQUIRE(next != std::string::npos);
  text.insert(next + 1, outcome.text.substr(lines) + "\n");
  std::ofstream(toml) << text;
  const RobotDescription tuned = LoadRobot(folder / "robot");
  CHECK(tuned.joints[0].noise.jerk > 0);
  const auto fresh = Swing(shipped, 2);
  CHECK(Deviance(tuned, fresh) < Deviance(shipped, fresh) - 0.1);
}

TEST_CASE("plumb estimate tune does not take for motion that the robot is placed") {
  const TemporaryFolder folder;
  constexpr size_t kEpisode = 500;  // samples
  std::vector<SimulatedReadings::Sample> samples = Swing(LoadRobot(Robot("pendulum")), 1);
  for (size_t i = 0; i < samples.size(); ++i)  // by less than reset_after
    samples[i].joints.position[0] += i / kEpisode % 2 == 0 ? 0 : 0.15;
  const auto position_sd = [&](size_t placed) {
    const Outcome outcome = Shell(Plumb() + "estimate tune " + Robot("pendulum") + " --log " +
                                  WriteLog(folder, samples, placed));
    INFO(outcome.text);
    REQUIRE(outcome.status == 0);
    return std::stod(outcome.text.substr(outcome.text.find("position_sd = ") + 14));
  };
  CHECK(position_sd(kEpisode) < 0.2 * position_sd(0));
}

TEST_CASE("plumb estimate tune refuses a log of another robot, and says that one is cut off") {
  const TemporaryFolder folder;
  const std::string log = WriteLog(folder, Swing(LoadRobot(Robot("pendulum")), 1));
  const std::string tune = Plumb() + "estimate tune " + Robot("pendulum") + " --log " + log;
  RecordFolder(log, {{}, {}, {}, {}, Robot("servo")});
  const Outcome other = Shell(tune);
  INFO(other.text);
  CHECK(other.status == 1);
  CHECK(other.text.find(log +
                        ": is a log of servo, not of pendulum: its joint 1 is shaft, not pivot") !=
        std::string::npos);

  fs::remove_all(log + ".d");
  fs::resize_file(log, fs::file_size(log) - 1);
  const Outcome cut = Shell(tune);
  INFO(cut.text);
  CHECK(cut.status == 0);
  CHECK(cut.text.find(log + ": its last message is cut off") != std::string::npos);
}

TEST_CASE("what does not look whether it is to stop ends at once, and leaves nothing behind") {
  const TemporaryFolder folder;
  const std::string log = WriteLog(folder, Swing(LoadRobot(Robot("pendulum")), 1)),
                    file = folder / "file";
  for (const std::string& command :
       {"estimate tune " + Robot("pendulum") + " --log " + log, "export " + log + " --mcap " + file,
        "export " + log + " --csv " + file,
        "export-model " + Robot("pendulum") + " --mjcf " + file}) {
    const Outcome outcome = ShellAskedToEnd(Plumb() + command);
    INFO(command << ": " << outcome.text);
    CHECK(outcome.status == 130);
    CHECK(outcome.text.empty());
    CHECK_FALSE(fs::exists(file));
  }
}

TEST_CASE("plumb estimate tune says what a log lacks") {
  const TemporaryFolder folder;
  const std::vector<SimulatedReadings::Sample> samples =
      Swing(LoadRobot(Robot("pendulum")), 1, 0.1);
  const Outcome little =
      Shell(Plumb() + "estimate tune " + Robot("pendulum") + " --log " + WriteLog(folder, samples));
  INFO(little.text);
  CHECK(little.status != 0);
  CHECK(little.text.find("pivot") != std::string::npos);
  const Outcome none =
      Shell(Plumb() + "estimate tune " + Robot("pendulum") + " --log " + WriteLog(folder, {}));
  INFO(none.text);
  CHECK(none.status != 0);
  CHECK(none.text.find("run.lcmlog: has no JOINT_STATE") != std::string::npos);
  CHECK(Shell(Plumb() + "estimate tune " + Robot("pendulum") + " --log /nonexistent").status != 0);
}

}  // namespace
}  // namespace plumb
