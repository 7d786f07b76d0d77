// A foreign witness on the bus, python-can, or candump where the bus is the kernel's, sees every
// frame of a run: as the run has it, and as the driver counts and records it.

#include <algorithm>
#include <regex>
#include <sstream>

#include "tests/process/stage.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

constexpr char kPython[] = R"(
import can, sys
bus = can.Bus(interface='udp_multicast', channel=sys.argv[1], port=int(sys.argv[2]),
              hop_limit=0, receive_own_messages=False)
print('ready', flush=True)
for m in bus:
    print('%03X#%s' % (m.arbitration_id,
                       'R' if m.is_remote_frame else m.data.hex().upper()), flush=True)
)";

Child StartWitness(const Stage& stage, const fs::path& log) {
  if (stage.bus_url.starts_with("socketcan:"))
    return Child("candump",
                 {"stdbuf", "-oL", "candump", "-L", "-r", "8000000", stage.bus_url.substr(10)},
                 log);
  const size_t colon = stage.bus_url.rfind(':');
  return Child("python3",
               {"/usr/bin/python3", "-c", kPython, stage.bus_url.substr(4, colon - 4),
                stage.bus_url.substr(colon + 1)},
               log);
}

/// candump writes the length of a remote frame, the run does not.
std::string Normal(std::string frame) {
  const size_t remote = frame.find("#R");
  return remote == std::string::npos ? frame : frame.substr(0, remote + 2);
}

/// The frames of a log, whoever wrote it: "02E#0000C03F".
std::vector<std::string> Frames(const std::string& log) {
  static const std::regex kFrame("(?:^|.* )([0-9A-F]{3}#[0-9A-FR]*)(?: .*)?");
  std::vector<std::string> frames;
  std::istringstream lines(log);
  for (std::string line; std::getline(lines, line);) {
    std::smatch match;
    if (std::regex_match(line, match, kFrame)) frames.push_back(Normal(match[1]));
  }
  return frames;
}

TEST_CASE("a foreign witness sees every frame of a run") {
  Stage stage(42);
  const fs::path log = stage.folder / "witness.log";
  std::vector<std::string> said, sent_by_driver;
  stage.coordinator->on_post = [&](const lockstep_post_t& post, const std::string& speaker) {
    if (post.topic.kind != lockstep_topic_t::FRAME) return;
    said.push_back(Normal({post.data.begin(), post.data.end()}));
    if (speaker == "plumb-driver") sent_by_driver.push_back(said.back());
  };
  Child witness = StartWitness(stage, log);
  const bool python = !stage.bus_url.starts_with("socketcan:");
  // In real time, while the run's stands still: until it is there, and until it has seen what there
  // is to see.
  const auto await = [&](const std::function<bool()>& so) {
    const bool seen = AwaitReally([&] { return so() || !witness.running(); }) && so();
    INFO(witness.Tail(5));
    REQUIRE(seen);
  };
  if (python) {
    await([&] { return Read(log).find("ready") != std::string::npos; });
  } else {
    // It hears us: otherwise it is not there yet.
    const auto other = OpenTransport(stage.bus_url);
    await([&] {
      other->Send(std::vector<Frame>{*FrameFromText("700#")});
      return Read("/proc/net/can/rcvlist_all").find(stage.bus_url.substr(10)) != std::string::npos;
    });
  }
  const auto seen = [&] {
    std::vector<std::string> frames = Frames(Read(log));
    std::erase(frames, "700#");
    return frames;
  };
  const auto watch = [&](double seconds) {
    for (double passed = 0; passed < seconds; passed += 0.05) {
      stage.Listen(0.05);
      await([&] { return seen().size() >= said.size(); });
    }
  };

  stage.StartAll();
  watch(1);  // all are up, and the driver's guard is over
  stage.Request(driver_request_t::ARM);
  watch(0.2);
  REQUIRE(stage.drivers.newest().state == driver_status_t::ARMED);
  stage.PublishPolicy();
  watch(2.5);
  REQUIRE(stage.torque != 0);
  // A fault: then the driver's own record of the last two seconds can be compared frame by frame.
  stage.Kill("plumb-controller");
  watch(0.5);
  REQUIRE(stage.drivers.newest().state == driver_status_t::FAULT);
  // At rest it still asks for temperatures; its last DRIVER_STATUS counts them all.
  stage.coordinator->Stop("plumb-driver");
  watch(0.1);
  REQUIRE_FALSE(stage.coordinator->present("plumb-driver"));
  std::vector<std::string> frames = seen();
  CHECK(frames.size() == said.size());
  CHECK(frames == said);
  CHECK(static_cast<int64_t>(sent_by_driver.size()) == stage.drivers.newest().buses[0].frames_sent);
  CHECK(stage.drivers.newest().buses[0].frames_dropped == 0);
  size_t recorded = 0;
  for (const auto& file : fs::directory_iterator(stage.folder / "faults")) {
    const std::vector<std::string> record =
        Frames(std::regex_replace(Read(file), std::regex("[^\n]* R\n"), ""));
    CHECK(std::ranges::search(sent_by_driver, record).size() == record.size());
    recorded += record.size();
  }
  CHECK(recorded > 300);  // 200 torques a second
}

}  // namespace
}  // namespace plumb
