// `plumb estimate tune`, run as a person would, and what it prints put where it says.
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <lcm/lcm-cpp.hpp>
#include <string>
#include <vector>

#include "tests/cli/shell.h"
#include "tests/estimator/observer_errors.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

std::string WriteLog(const TemporaryFolder& folder,
                     const std::vector<SimulatedReadings::Sample>& samples) {
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
  for (const SimulatedReadings::Sample& sample : samples) {
    for (const imu_t& imu : sample.imus) write("IMU", imu);
    write("JOINT_STATE", sample.joints);
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
