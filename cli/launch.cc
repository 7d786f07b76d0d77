#include "cli/launch.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <iostream>
#include <optional>
#include <stdexcept>

#include "cli/child.h"
#include "cli/preflight.h"
#include "cli/progress.h"
#include "common/atomic_file.h"
#include "common/lcm_url.h"
#include "common/signature.h"
#include "drivers/driver.h"
#include "plumb/driver_request_t.hpp"
#include "robot/description.h"
#include "sim/parameters.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using SteadyClock = std::chrono::steady_clock;

constexpr int kMostRearms = 20; // of a virtual robot; a real one is armed by a person, every time

double SecondsSince(SteadyClock::time_point start) {
  return std::chrono::duration<double>(SteadyClock::now() - start).count();
}

// What the driver would say in its log, said before anything starts.
void RequireDrivable(const RobotDescription& robot) {
  try {
    Driver(robot, 0, 0);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(fmt::format("{} cannot be launched (plumb sim simulates it): {}", robot.name, error.what()));
  }
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
    for (const std::string& warning : robot_.warnings) spdlog::warn("{}", warning);
    RequireDrivable(robot_);
    RequireKey(process.lcm_url(), !flags.key.empty(), flags.allow_unsigned);
    if (!flags.key.empty()) signer_.emplace(SigningKey(flags.key), "DRIVER_REQUEST");
    if (flags.real && flags.speed != 1) throw std::invalid_argument("a real robot runs at --speed 1");
    RequireFree(process, bus_, flags.real);
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
    if (flags_.real) {
      const int status = ArmByPerson();
      if (status != 0) return status;
    }
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
      // It knows no --parent of ours.
      Start("setpriv", {"--pdeathsig", "TERM", "lcm-logger", "--lcm-url=" + process_.lcm_url(), "-q", "-f", flags_.log});
    }
    const std::vector<std::string> behind{"--realtime-priority", std::to_string(std::max(flags_.priority - 5, 0))};
    if (!flags_.real) Start("plumb-robot", {flags_.robot, "--bus", bus_, "--seed", seed, behind[0], behind[1]});
    std::vector<std::string> driver{flags_.robot, "--bus", bus_, "--flight-recorder",
                                    (output_ / "faults").string()};
    if (!flags_.real) driver.push_back("--virtual");
    if (flags_.allow_unsigned) driver.push_back("--unsigned");
    driver.insert(driver.end(), {"--realtime-priority", std::to_string(flags_.priority)});
    std::vector<std::string> controller{flags_.robot, "--seed", seed, behind[0], behind[1]};
    if (flags_.real) controller.insert(controller.end(), {"--rest", "5"});  // nobody throws a real robot about
    if (!flags_.key.empty()) {
      for (auto* arguments : {&driver, &controller})
        arguments->insert(arguments->end(), {"--key", flags_.key});
    }
    Start("plumb-driver", driver);
    Start("plumb-estimator", {flags_.robot, behind[0], behind[1]});
    Start("plumb-controller", controller);
    // The slow loop gives way to the fast one.
    Start("plumb-trainer", {flags_.robot, "--nice", "10", "--seed", seed, "--iterations", std::to_string(flags_.iterations),
                            "--evaluation-episodes", std::to_string(flags_.evaluation_episodes), "--checkpoint",
                            (output_ / "training").string()});
    Start("plumb-calibrator", {flags_.robot, "--nice", "10", "--seed", seed, "--checkpoint", (output_ / "calibration").string()});
  }

  // One consent is one attempt. @return 0 when armed, else the exit status.
  int ArmByPerson() {
    const auto until = [&](const std::function<bool()>& so, double seconds) {
      const auto start = SteadyClock::now();
      while (!so() && SecondsSince(start) < seconds && AllRunning()) {
        if (!process_.Wait(50'000)) return false;
      }
      return so();
    };
    const auto state_is = [&](int8_t state) { return progress_.driver().state == state; };
    if (!until([&] { return state_is(driver_status_t::IDLE); }, 5)) {
      std::cerr << "plumb: the driver is not ready to arm: " << progress_.driver().reason << std::endl;
      return process_.stopping() ? 130 : 1;
    }
    until([] { return false; }, robot_.driver.start_guard + 0.1);  // the driver refuses any earlier wish
    std::cout << "The motors of " << robot_.name << " on " << bus_
              << " will be switched on.\nStand clear, keep the emergency stop at hand, and type 'arm': " << std::flush;
    std::string answer;
    while (answer.empty() || answer.back() != '\n') {
      if (!process_.Wait(1'000'000, STDIN_FILENO)) return 130;
      pollfd input{STDIN_FILENO, POLLIN, 0};
      char c = 0;
      while (poll(&input, 1, 0) > 0 && answer.find('\n') == std::string::npos) {
        if (read(STDIN_FILENO, &c, 1) != 1) c = '\n';
        answer.push_back(c);
      }
      if (!AllRunning()) return 1;
    }
    if (answer != "arm\n") {
      std::cout << "not armed" << std::endl;
      return 1;
    }
    Request(driver_request_t::ARM);
    if (until([&] { return state_is(driver_status_t::ARMED); }, 3)) return 0;
    std::cerr << "plumb: not armed: " << progress_.driver().reason << std::endl;
    return process_.stopping() ? 130 : 1;
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

  // A virtual robot is armed at the beginning, and again after a fault, though not for ever. What a person has
  // stopped, and a real robot in any case, only a person starts.
  bool KeepArmed() {
    const driver_status_t& driver = progress_.driver();
    if (driver.stopped_by_request != stopped_) {
      stopped_ = driver.stopped_by_request;
      if (stopped_) Print("stopped by request. To go on: " + ArmCommand());
    }
    if (stopped_) return true;
    if (driver.state == driver_status_t::FAULT && !fault_seen_) {
      fault_seen_ = true;
      Print("driver fault: " + driver.reason);
      if (flags_.real) Print("Look at the robot. To go on: " + ArmCommand());
      if (!flags_.real && ++rearms_ > kMostRearms) {
        std::cerr << "plumb: too many faults\n";
        return false;
      }
    }
    if (driver.state == driver_status_t::ARMED) fault_seen_ = false;
    const bool down = driver.state == driver_status_t::IDLE || driver.state == driver_status_t::FAULT;
    if (down && !flags_.real && SecondsSince(last_request_) * flags_.speed > 0.5) {
      Request(driver_request_t::ARM);
      last_request_ = SteadyClock::now();
    }
    return true;
  }

  /// For a person to type.
  std::string ArmCommand() const {
    return "plumb arm --lcm-url '" + process_.lcm_url() + "'" +
           (flags_.key.empty() ? "" : " --key '" + flags_.key + "'");
  }

  void Request(int8_t what) {
    driver_request_t request{};
    request.utime = clock_.Utime();
    request.request = what;
    if (signer_) signer_->Sign(request, Clock().Utime());
    requests_.Publish(request);
  }

  void StopAll() {
    // Everything that could command goes at once; the driver disarms and confirms; the robot and the log go last.
    for (Child& child : children_) {
      if (child.name() != "plumb-robot" && child.name() != "setpriv") child.Signal(SIGTERM);
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
  std::optional<Signer> signer_;
  Subscriber<driver_status_t> drivers_;
  Subscriber<controller_status_t> controllers_;
  Subscriber<calibration_status_t> calibrations_;
  Subscriber<training_status_t> trainings_;
  Eigen::VectorXd truth_;
  fs::path output_;
  std::vector<Child> children_;
  SteadyClock::time_point start_ = SteadyClock::now(), last_status_ = start_, last_request_ = start_;
  bool line_open_ = false, fault_seen_ = false, stopped_ = false;
  int rearms_ = 0;
};

}  // namespace

int Launch(Process& process, const LaunchFlags& flags) { return ClosedLoop(process, flags).Go(); }

}  // namespace plumb
