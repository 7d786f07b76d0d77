#include "cli/launch.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <chrono>
#include <iostream>
#include <stdexcept>

#include "cli/child.h"
#include "cli/progress.h"
#include "common/atomic_file.h"
#include "drivers/can/transport.h"
#include "plumb/driver_request_t.hpp"
#include "robot/description.h"
#include "sim/parameters.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using SteadyClock = std::chrono::steady_clock;

constexpr int kMostRearms = 5;  // of a virtual robot; a real one is armed by a person, every time

double SecondsSince(SteadyClock::time_point start) {
  return std::chrono::duration<double>(SteadyClock::now() - start).count();
}

/// One run: its processes and what they say.
class ClosedLoop {
 public:
  ClosedLoop(Process& process, const LaunchFlags& flags)
      : process_(process),
        flags_(flags),
        robot_(LoadRobot(flags.robot)),
        bus_(flags.bus.empty() ? robot_.bus_url : flags.bus),
        clock_(flags.speed, process.clock().Utime()),
        progress_(robot_, flags.iterations),
        requests_(process.messenger(), "DRIVER_REQUEST"),
        drivers_(process.messenger(), "DRIVER_STATUS", [&](const driver_status_t& m) { progress_.OnDriver(m); }),
        controllers_(process.messenger(), "CONTROLLER_STATUS",
                     [&](const controller_status_t& m) { progress_.OnController(m); }),
        calibrations_(process.messenger(), "CALIBRATION_STATUS",
                      [&](const calibration_status_t& m) { progress_.OnCalibration(m); }),
        trainings_(process.messenger(), "TRAINING_STATUS",
                   [&](const training_status_t& m) { progress_.OnTraining(m); }) {
    if (flags.real && flags.speed != 1) throw std::invalid_argument("a real robot runs at --speed 1");
    OpenTransport(bus_);  // throws one clear line before anything has been started
    if (!flags.real) truth_ = HiddenParameters(robot_, flags.seed);
    output_ = flags.output.empty() ? fs::path("runs") / fmt::format("{:%Y-%m-%d-%H%M%S}-{}",
                                                                    fmt::localtime(std::time(nullptr)), getpid())
                                   : fs::path(flags.output);
    fs::create_directories(output_);
  }

  ~ClosedLoop() { StopAll(); }

  int Go() {
    std::cout << VersionLine("plumb") << ", " << robot_.name << " on " << bus_ << ", seed " << flags_.seed
              << ", logs in " << output_.string() << std::endl;
    StartAll();
    if (flags_.real && !PersonAgrees()) return 1;
    std::cout << progress_.Header() << std::endl;
    while (!progress_.finished()) {
      if (!process_.Wait(50'000)) {
        EndLine();
        std::cout << "interrupted" << std::endl;
        StopAll();
        return 130;
      }
      progress_.Account(SecondsSince(start_));
      if (!AllRunning()) return 1;
      if (!KeepArmed()) return 1;
      for (const std::string& row : progress_.TakeRows()) Print(row);
      ShowStatus();
    }
    EndLine();
    StopAll();
    std::cout << progress_.Conclusion(truth_);
    WriteSummary();
    return 0;
  }

 private:
  void Start(const std::string& name, std::vector<std::string> arguments) {
    const fs::path here = fs::read_symlink("/proc/self/exe").parent_path();
    const bool ours = name.rfind("plumb-", 0) == 0;
    arguments.insert(arguments.begin(), ours ? (here / name).string() : name);
    if (ours) {
      for (const std::string& flag : {std::string("--lcm-url"), process_.lcm_url(), std::string("--clock"),
                                      clock_.ToString(), std::string("--parent"), std::to_string(getpid())}) {
        arguments.push_back(flag);
      }
    }
    children_.emplace_back(name, arguments, output_ / (name + ".log"));
  }

  void StartAll() {
    const std::string seed = std::to_string(flags_.seed);
    if (!flags_.log.empty()) {
      Start("lcm-logger", {"--lcm-url=" + process_.lcm_url(), "-q", "-f", flags_.log});
    }
    if (!flags_.real) Start("plumb-robot", {flags_.robot, "--bus", bus_, "--seed", seed});
    Start("plumb-driver", {flags_.robot, "--bus", bus_});
    Start("plumb-estimator", {flags_.robot});
    Start("plumb-controller", {flags_.robot, "--seed", seed});
    Start("plumb-trainer", {flags_.robot, "--seed", seed, "--iterations", std::to_string(flags_.iterations),
                            "--evaluation-episodes", std::to_string(flags_.evaluation_episodes), "--checkpoint",
                            (output_ / "training").string()});
    Start("plumb-calibrator", {flags_.robot, "--seed", seed, "--checkpoint", (output_ / "calibration").string()});
  }

  bool PersonAgrees() {
    std::cout << "The motors of " << robot_.name << " on " << bus_
              << " will be switched on.\nStand clear, keep the emergency stop at hand, and type 'arm': " << std::flush;
    std::string answer;
    std::getline(std::cin, answer);
    if (answer == "arm") return true;
    std::cout << "not armed" << std::endl;
    return false;
  }

  bool AllRunning() {
    for (Child& child : children_) {
      if (child.running()) continue;
      EndLine();
      std::cerr << "plumb: " << child.name() << " ended (" << child.ending() << "); the end of "
                << child.log().string() << ":\n"
                << child.Tail(5);
      return false;
    }
    return true;
  }

  // Asks for arming at the beginning; after a fault only for a virtual robot, and not for ever.
  bool KeepArmed() {
    const driver_status_t& driver = progress_.driver();
    if (driver.state == driver_status_t::FAULT && !fault_seen_) {
      fault_seen_ = true;
      Print("driver fault: " + driver.reason);
      if (flags_.real) Print("Look at the robot. To go on: plumb arm");
      if (!flags_.real && ++rearms_ > kMostRearms) {
        std::cerr << "plumb: too many faults\n";
        return false;
      }
    }
    if (driver.state == driver_status_t::ARMED) fault_seen_ = false, armed_once_ = true;
    const bool idle = driver.state == driver_status_t::IDLE && (!armed_once_ || !flags_.real);
    const bool fault = driver.state == driver_status_t::FAULT && !flags_.real;
    if ((idle || fault) && SecondsSince(last_request_) * flags_.speed > 0.5) {
      Request(driver_request_t::ARM);
      last_request_ = SteadyClock::now();
    }
    return true;
  }

  void Request(int8_t what) {
    driver_request_t request{};
    request.utime = clock_.Utime();
    request.request = what;
    requests_.Publish(request);
  }

  void StopAll() {
    // Everything that could command goes at once; the driver disarms and confirms; the robot and the log go last.
    for (Child& child : children_) {
      if (child.name() != "plumb-robot" && child.name() != "lcm-logger") child.Signal(SIGTERM);
    }
    for (Child& child : children_) {
      if (child.name() == "plumb-driver") child.WaitFor(0.5);
    }
    for (Child& child : children_) child.Signal(SIGTERM);
    const auto start = SteadyClock::now();
    for (Child& child : children_) {
      if (!child.WaitFor(std::max(0.0, 0.3 - SecondsSince(start)))) child.Signal(SIGKILL);
    }
    for (Child& child : children_) child.WaitFor(0.2);
    children_.clear();
  }

  void WriteSummary() {
    if (flags_.summary.empty()) return;
    nlohmann::json summary = progress_.Summary(truth_);
    summary["seed"] = flags_.seed;
    summary["speed"] = flags_.speed;
    summary["bus"] = bus_;
    summary["rearms"] = rearms_;
    summary["version"] = VersionLine("plumb");
    summary["seconds"]["total"] = SecondsSince(start_);
    WriteAtomically(flags_.summary, summary.dump(1) + "\n");
  }

  void Print(const std::string& line) {
    EndLine();
    std::cout << line << std::endl;
  }
  void EndLine() {
    if (line_open_) std::cout << "\r\033[K" << std::flush;
    line_open_ = false;
  }
  void ShowStatus() {
    const bool terminal = isatty(STDOUT_FILENO) != 0;
    if (SecondsSince(last_status_) < (terminal ? 0.1 : 10)) return;
    last_status_ = SteadyClock::now();
    const std::string line = progress_.StatusLine(SecondsSince(start_));
    if (terminal) {
      std::cout << "\r\033[K" << line << std::flush;
      line_open_ = true;
    } else {
      std::cout << line << std::endl;
    }
  }

  Process& process_;
  const LaunchFlags& flags_;
  RobotDescription robot_;
  std::string bus_;
  Clock clock_;
  Progress progress_;
  Publisher<driver_request_t> requests_;
  Subscriber<driver_status_t> drivers_;
  Subscriber<controller_status_t> controllers_;
  Subscriber<calibration_status_t> calibrations_;
  Subscriber<training_status_t> trainings_;
  Eigen::VectorXd truth_;
  fs::path output_;
  std::vector<Child> children_;
  SteadyClock::time_point start_ = SteadyClock::now(), last_status_ = start_, last_request_ = start_;
  bool line_open_ = false, fault_seen_ = false, armed_once_ = false;
  int rearms_ = 0;
};

}  // namespace

int Launch(Process& process, const LaunchFlags& flags) { return ClosedLoop(process, flags).Go(); }

}  // namespace plumb
