#include "cli/run_processes.h"

#include <fmt/format.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>

#include "common/time_units.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using SteadyClock = std::chrono::steady_clock;

constexpr char kRobotProcess[] = "plumb-robot", kDriver[] = "plumb-driver",
               kRecorder[] = "plumb-record";

// What a child says, in its log, from these words to the end of their line; nothing if it ends
// before, or has not said so in time.
std::string WaitForLine(Child& child, const char* words) {
  constexpr double kPatience = 10;  // [s]
  const auto start = SteadyClock::now();
  while (child.running() && SecondsSince(start) < kPatience) {
    const std::string log = child.Tail(10);
    const size_t begin = log.find(words), end = log.find('\n', begin);
    if (begin != std::string::npos && end != std::string::npos)
      return log.substr(begin, end - begin);
    child.WaitFor(0.02);
  }
  return "";
}

}  // namespace

std::vector<std::string> RunProcesses::Command(const std::string& name,
                                               std::vector<std::string> arguments,
                                               const std::string& clock) const {
  const fs::path here = fs::read_symlink("/proc/self/exe").parent_path();
  arguments.insert(arguments.begin(), here / (name == kRecorder ? "plumb" : name));
  arguments.insert(arguments.end(),
                   {"--lcm-url", where_.lcm_url, "--clock", clock, "--parent",
                    std::to_string(getpid()), "--run", std::to_string(where_.run)});
  if (!where_.key_file.empty()) arguments.insert(arguments.end(), {"--key", where_.key_file});
  return arguments;
}

void RunProcesses::Start(const std::string& name, std::vector<std::string> arguments) {
  children_.emplace_back(name, Command(name, std::move(arguments), where_.clock),
                         where_.output / (name + ".log"));
  if (coordinator_) coordinator_->Expect(name, children_.back().pid());
}

std::string RunProcesses::StartDashboard() {
  constexpr char kName[] = "plumb-dashboard", kSays[] = "dashboard: ";
  std::vector<std::string> arguments{flags_.robot, "--address", flags_.dashboard};
  for (const std::string& origin : flags_.origins)
    arguments.insert(arguments.end(), {"--origin", origin});
  if (coordinator_) arguments.push_back("--virtual");
  dashboard_.emplace(kName, Command(kName, arguments, coordinator_ ? "1" : where_.clock),
                     where_.output / (std::string(kName) + ".log"));
  std::string said = WaitForLine(*dashboard_, kSays);
  if (!said.empty()) return said;
  const std::string why = dashboard_->Tail(1);
  return "no dashboard: " + why.substr(0, why.find_last_not_of(" \n") + 1);
}

void RunProcesses::Start() {
  const std::string seed = std::to_string(flags_.seed);
  const auto with_priority = [&](std::vector<std::string> arguments, int behind) {
    const int priority = std::max(flags_.priority - behind, 0);
    if (priority > 0)
      arguments.insert(arguments.end(), {"--realtime-priority", std::to_string(priority)});
    return arguments;
  };
  if (!flags_.log.empty() && !coordinator_) {
    Start(kRecorder,
          {"record", flags_.log, "--overwrite", "--robot", flags_.robot, "--note", flags_.command});
    WaitForLine(children_.back(), "recording to ");  // what is said before it listens is lost
  }
  std::vector<std::string> virtual_robot{flags_.robot, "--seed", seed};
  std::vector<std::string> driver{flags_.robot, "--flight-recorder",
                                  (where_.output / "faults").string()};
  for (const std::string& bus : where_.buses) {
    for (auto* arguments : {&virtual_robot, &driver})
      arguments->insert(arguments->end(), {"--bus", bus});
  }
  if (!flags_.real) Start(kRobotProcess, with_priority(virtual_robot, 5));
  if (!flags_.real) driver.push_back("--virtual");
  if (flags_.allow_unsigned) driver.push_back("--unsigned");
  std::vector<std::string> controller{flags_.robot, "--seed", seed};
  // a real robot cannot be placed: it rests, then its episode begins where it is
  if (flags_.real) controller.insert(controller.end(), {"--rest", "5"});
  if (!flags_.efforts.empty()) controller.insert(controller.end(), {"--efforts", flags_.efforts});
  Start(kDriver, with_priority(driver, 0));
  Start("plumb-estimator", with_priority({flags_.robot}, 5));
  Start("plumb-controller", with_priority(controller, 5));
  // In real time the slow loop gives way to the fast one.
  const auto start_slow = [&](const std::string& name, std::vector<std::string> arguments) {
    if (!coordinator_) arguments.insert(arguments.end(), {"--nice", "10"});
    Start(name, arguments);
  };
  const std::string episodes = std::to_string(flags_.evaluation_episodes);
  if (!flags_.policy.empty()) {
    start_slow("plumb-trainer",
               {flags_.robot, "--policy", flags_.policy, "--evaluation-episodes", episodes});
    return;
  }
  start_slow("plumb-calibrator", {flags_.robot, "--seed", seed, "--checkpoint",
                                  (where_.output / kCalibrationFolder).string()});
  if (!flags_.efforts.empty()) return;
  start_slow("plumb-trainer", {flags_.robot, "--seed", seed, "--iterations",
                               std::to_string(flags_.iterations), "--evaluation-episodes", episodes,
                               "--checkpoint", (where_.output / kTrainingFolder).string()});
}

Child* RunProcesses::Ended() {
  const auto ended = std::ranges::find_if(children_, [](Child& child) { return !child.running(); });
  return ended == children_.end() ? nullptr : &*ended;
}

void RunProcesses::Stop(bool hurry) noexcept {
  if (children_.empty() && !dashboard_) return;
  try {
    if (coordinator_) StopInVirtualTime(hurry);
  } catch (const std::exception& error) {
    spdlog::error("{}", error.what());
  }
  StopInRealTime();
  children_.clear();
  if (!dashboard_) return;  // it has seen the end
  dashboard_->Signal(SIGTERM);
  if (!dashboard_->WaitFor(0.3)) dashboard_->Signal(SIGKILL);
  dashboard_.reset();
}

/// Everything that could command ends at one moment; the driver disarms and confirms; the robot
/// goes last.
void RunProcesses::StopInVirtualTime(bool hurry) {
  constexpr int64_t kSlice = 10'000;  // [us]
  const int64_t timeout = Microseconds(disarm_patience_ + 0.7);
  const auto start = SteadyClock::now();
  const auto in_time = [&] { return !hurry || SecondsSince(start) < patience_; };
  coordinator_->go_on = in_time;
  const auto anybody = [&](const auto& whom) {
    return std::ranges::any_of(children_, [&](const Child& child) {
      return whom(child) && coordinator_->present(child.name());
    });
  };
  const auto stop = [&](const auto& whom) {
    for (const Child& child : children_) {
      if (whom(child)) coordinator_->Stop(child.name());
    }
    const int64_t deadline = coordinator_->now() + timeout;
    while (anybody(whom) && coordinator_->now() < deadline && in_time()) {
      coordinator_->participant().Wait(coordinator_->now() + kSlice, Participant::Wake::kOnTime);
    }
  };
  stop([](const Child& child) { return child.name() != kRobotProcess; });
  stop([](const Child&) { return true; });
}

void RunProcesses::StopInRealTime() {
  for (Child& child : children_) {
    if (child.name() != kRobotProcess && child.name() != kRecorder) child.Signal(SIGTERM);
  }
  for (Child& child : children_) {
    if (child.name() == kDriver) child.WaitFor(disarm_patience_ + 0.2);
  }
  for (Child& child : children_) child.Signal(SIGTERM);
  const auto start = SteadyClock::now();
  const auto end = [&](bool records, double seconds) {
    for (Child& child : children_) {
      if ((child.name() == kRecorder) != records) continue;
      if (!child.WaitFor(std::max(0.0, seconds - SecondsSince(start)))) child.Signal(SIGKILL);
      child.WaitFor(0.2);
      if (records && child.ending() != "exit status 0")
        record_fault_ =
            fmt::format("the record is not whole: {} ended ({}); the end of {}:\n{}", child.name(),
                        child.ending(), child.log().string(), child.Tail(5));
    }
  };
  end(false, 0.3);
  end(true, 10);  // it commands nothing, and may have to wait for a slow disk
}

}  // namespace plumb
