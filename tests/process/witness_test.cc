// A foreign witness on the bus writes down what it sees: python-can's logger, or candump where the bus is the
// kernel's. All that the driver says it sent is there. $PLUMBLINE_WITNESS_SECONDS: for how long (3).

#include <algorithm>
#include <regex>
#include <sstream>
#include <utility>

#include "tests/process/stage.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

/// The frames of a log, as candump writes them ("02E#0000C03F"), that a host sends to an ODrive: setpoints,
/// orders, and requests. What a drive says has other ids, but for the answers to requests, which are no
/// remote frames.
std::vector<std::string> FramesOfHost(const std::string& log) {
  static const std::regex kFrame(
      "^\\([0-9.]+\\) \\S+ (0(?:22|27|2B|2E|38)#[0-9A-F]*|[0-9A-F]{3}#R[0-9]?)(?: .*)?$");
  std::vector<std::string> frames;
  std::istringstream lines(log);
  for (std::string line; std::getline(lines, line);) {
    std::smatch match;
    if (std::regex_match(line, match, kFrame)) frames.push_back(match[1]);
  }
  return frames;
}

Child StartWitness(const Stage& stage, const fs::path& log) {
  if (stage.bus_url.starts_with("socketcan:"))
    return Child("candump", {"candump", "-L", "-r", "8000000", stage.bus_url.substr(10)}, log);
  const size_t colon = stage.bus_url.rfind(':');
  return Child("can_logger",
               {"/usr/bin/can_logger", "-i", "udp_multicast", "-c", stage.bus_url.substr(4, colon - 4),
                "--port=" + stage.bus_url.substr(colon + 1), "--hop-limit=0", "-f", log},
               stage.folder / "witness.output");
}

TEST_CASE("a foreign witness sees every frame that the driver says it sent") {
  const double seconds = std::stod(Stage::Environment("PLUMBLINE_WITNESS_SECONDS", "3"));
  Stage stage(42);
  const fs::path log = stage.folder / "witness.log";
  Child witness = StartWitness(stage, log);
  // It hears us: otherwise it is not there yet. Many, because it keeps back what it writes.
  const std::vector<Frame> hello(64, *FrameFromText("700#"));
  REQUIRE(stage.WaitUntil(
      [&] {
        stage.bus->Send(hello);
        stage.Listen(0.2);
        return Read(log).find("700#") != std::string::npos || !witness.running();
      },
      20));
  INFO(witness.Tail(5));
  REQUIRE(witness.running());

  stage.RunWithTorque();
  // A busy machine may stop the robot: what is sent then counts, too.
  for (const int64_t end = Stage::RealUtime() + static_cast<int64_t>(seconds * 1e6);
       Stage::RealUtime() < end;) {
    stage.Listen(std::min(1., seconds));
    if (stage.drivers.newest().state == driver_status_t::FAULT) stage.BeginEpisode();
  }
  // A fault: then the driver's own record of the last two seconds can be compared frame by frame.
  stage.children.at("plumb-controller")->Signal(SIGKILL);
  REQUIRE(stage.WaitForDriver(driver_status_t::FAULT, 5));
  REQUIRE(stage.WaitUntil([&] { return stage.axis_state == 1; }, 2));
  // At rest it still asks for temperatures; its last DRIVER_STATUS counts them all.
  stage.children.at("plumb-driver")->Signal(SIGTERM);
  REQUIRE(stage.children.at("plumb-driver")->WaitFor(5));
  stage.Listen(1);
  witness.Signal(SIGINT);  // it writes what it has kept back
  REQUIRE(witness.WaitFor(5));
  const std::vector<std::string> seen = FramesOfHost(Read(log));
  WARN("over " << seconds << " s the driver sent " << stage.drivers.newest().frames_sent
               << " frames, the witness saw " << seen.size());
  CHECK(static_cast<int64_t>(seen.size()) == stage.drivers.newest().frames_sent);
  CHECK(stage.drivers.newest().frames_dropped == 0);

  size_t recorded = 0;
  for (const auto& file : fs::directory_iterator(stage.folder / "faults")) {
    const std::vector<std::string> sent =
        FramesOfHost(std::regex_replace(Read(file), std::regex("[^\n]* R\n"), ""));
    CHECK((sent.empty() || std::ranges::search(seen, sent).size() == sent.size()));
    recorded += sent.size();
  }
  CHECK(recorded > 100);  // 200 torques a second
}

}  // namespace
}  // namespace plumb
