// One state that no robot can have been in, in the first roll-out that the calibrator hears.

#include <cmath>
#include <nlohmann/json.hpp>

#include "calibrator/motion/log_reader.h"
#include "plumb/parameter_distribution_t.hpp"
#include "tests/process/launch.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

template <class Message>
std::optional<Message> Decoded(const void* data, int size) {
  Message message;
  if (message.decode(data, 0, size) == size) return message;
  return {};
}

/// Plays to the calibrator what a log tells of the robot's motion, each roll-out as soon as the one
/// before it has been dealt with; and once, in the middle of the first, a state with an effort of
/// 1e150 in the true one's place.
void Play(Stage& stage, const fs::path& log) {
  Subscriber<parameter_distribution_t> found(stage.messenger, "PARAMETER_DISTRIBUTION");
  int64_t commands = 0, events = 0;
  bool forged = false;
  ReadLog(log, [&](const std::string& channel, const void* data, int size, int64_t) {
    if (channel != "ROBOT_STATE_SMOOTHED" && channel != "JOINT_COMMAND" &&
        channel != "CONTROLLER_STATUS")
      return true;
    const auto* begin = static_cast<const uint8_t*>(data);
    std::vector<uint8_t> bytes(begin, begin + size);
    if (channel == "JOINT_COMMAND" && Decoded<joint_command_t>(data, size)->episode >= 0)
      ++commands;
    if (channel == "ROBOT_STATE_SMOOTHED" && commands >= 100 && !forged) {
      auto state = *Decoded<robot_state_t>(data, size);
      state.effort.assign(state.effort.size(), 1e150);
      state.encode(bytes.data(), 0, size);
      forged = true;
    }
    stage.messenger.Publish(channel, bytes);
    if (++events % 20 == 0) stage.Listen(0.001);
    if (channel != "CONTROLLER_STATUS") return true;
    const auto status = *Decoded<controller_status_t>(data, size);
    if (status.phase == controller_status_t::COMPLETE && status.purpose == policy_t::CALIBRATE) {
      // The last states of a roll-out come after it: not for all of them is waited here.
      stage.WaitUntil([&] { return found.newest().iteration > status.policy_iteration; }, 0.2);
    }
    return true;
  });
  REQUIRE(forged);
  REQUIRE(stage.WaitUntil([&] { return found.newest().iteration == 2; }, kLong));
}

TEST_CASE("a calibrator that hears one impossible state learns from all the others") {
  Stage stage(65);
  LearnLittle(stage);
  const fs::path log = stage.folder / "run.lcmlog";
  Child launch("plumb",
               {Stage::Binary("plumb"), "launch", stage.robot_folder, "--lcm-url", "memq://",
                "--bus", "loop:", "--iterations", "2", "--evaluation-episodes", "1", "--log", log,
                "--output", stage.folder / "run"},
               stage.folder / "launch.log");
  REQUIRE(launch.WaitFor(kLong));
  INFO(launch.Tail(20));
  REQUIRE_FALSE(launch.failed());

  Child& calibrator =
      stage.Start("plumb-calibrator", {"--checkpoint", stage.folder / "calibration"});
  Play(stage, log);
  CHECK(calibrator.running());
  for (const char* file : {"posterior_1.json", "posterior_2.json"}) {
    INFO(file);
    const json clean = json::parse(Read(stage.folder / "run/calibration" / file)),
               found = json::parse(Read(stage.folder / "calibration" / file));
    CHECK(clean.at("mean") != found.at("mean"));  // a transition is missing
    for (size_t i = 0; i < stage.robot.parameters.size(); ++i) {
      INFO(stage.robot.parameters[i].name);
      const double sd = clean.at("sd")[i];
      CHECK(found.at("mean")[i].get<double>() ==
            Approx(clean.at("mean")[i].get<double>()).margin(2 * sd));
      CHECK(found.at("sd")[i].get<double>() == Approx(sd).epsilon(0.2));
    }
  }
}

}  // namespace
}  // namespace plumb
