#include "cli/launch.h"

#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <functional>
#include <iostream>
#include <optional>
#include <set>

#include "cli/launch_report.h"
#include "cli/progress.h"
#include "cli/rearming.h"
#include "cli/run_processes.h"
#include "cli/run_setting.h"
#include "common/atomic_file.h"
#include "common/decoded.h"
#include "common/outside_text.h"
#include "common/progress_line.h"
#include "common/time_units.h"
#include "plumb/driver_request_t.hpp"

namespace plumb {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr int64_t kPoll = 50'000;           // [us]
constexpr int64_t kDoubt = 300'000;         // [us]; three statuses of the controller
constexpr size_t kMaxStrangeChannels = 10;  // that are named: strangers choose how many there are

int CalibrationsOf(const LaunchFlags& flags) {
  if (!flags.policy.empty()) return 0;
  return flags.efforts.empty() ? flags.iterations : 1;
}

/// One run: its processes and what they say.
class ClosedLoop {
 public:
  ClosedLoop(Process& process, const LaunchFlags& flags, RunSetting& setting)
      : process_(process),
        flags_(flags),
        setting_(setting),
        robot_(setting.robot),
        clock_(process.participant()
                   ? process.clock()
                   : Clock(flags.speed > 0 ? flags.speed : 1, process.clock().Utime())),
        start_(clock_.Now()),
        progress_(robot_, CalibrationsOf(flags), !flags.efforts.empty()),
        requests_(process.messenger(), "DRIVER_REQUEST"),
        drivers_(process.messenger(), "DRIVER_STATUS",
                 [&](const driver_status_t& m) { Account(), progress_.OnDriver(m); }),
        controllers_(process.messenger(), "CONTROLLER_STATUS",
                     [&](const controller_status_t& m) { Account(), progress_.OnController(m); }),
        calibrations_(
            process.messenger(), "CALIBRATION_STATUS",
            [&](const calibration_status_t& m) { Account(), progress_.OnCalibration(m); }),
        trainings_(process.messenger(), "TRAINING_STATUS",
                   [&](const training_status_t& m) { Account(), progress_.OnTraining(m); }),
        processes_(flags,
                   {UrlsOf(robot_.buses), process.lcm_url(),
                    setting.coordinator() ? setting.coordinator()->clock() : clock_.ToString(),
                    process.key_file(), setting.run, setting.output},
                   setting.robot.driver, setting.coordinator()) {
    if (!setting.virtual_run) return;
    setting.coordinator()->on_note = [this](const std::string& line) { Print("plumb: " + line); };
    setting.coordinator()->go_on = [this] { return GoOn(); };
  }

  int Run() {
    std::cout << VersionLine("plumb") << ", " << robot_.name << " on " << InOneLine(robot_.buses)
              << ", seed " << flags_.seed << ", logs in " << setting_.output.string() << std::endl;
    if (setting_.virtual_run && !setting_.virtual_run->mirror_failure().empty()) {
      std::cout << "nobody else can listen: " << setting_.virtual_run->mirror_failure()
                << std::endl;
    }
    if (!flags_.dashboard.empty()) std::cout << processes_.StartDashboard() << std::endl;
    processes_.Start();
    if (flags_.real) {
      const int status = ArmByPerson();
      if (status != 0) return status;
    }
    if (flags_.policy.empty()) std::cout << progress_.Header() << std::endl;
    // In real time anybody might have said that it is finished: the controller, which repeats it,
    // is given the time to speak, and two speakers end the run.
    const int64_t doubt = setting_.virtual_run ? 0 : kDoubt;
    int64_t finished = 0;
    while (!progress_.finished() || clock_.Now() < finished + doubt) {
      if (!process_.Wait(kPoll)) {
        line_.Clear();
        processes_.Hurry();
        std::cout << "interrupted; " << GoesOn() << std::endl;
        return 130;
      }
      if (setting_.virtual_run) setting_.virtual_run->Rethrow();
      if (progress_.finished() && finished == 0) finished = clock_.Now();
      Account();
      if (!AllRunning() || !KeepArmed()) return 1;
      for (const std::string& row : progress_.TakeRows()) Print(row);
      ShowStatus();
    }
    line_.Clear();
    processes_.Stop(false);
    if (setting_.virtual_run) setting_.virtual_run->Finish();
    std::cout << progress_.Conclusion(setting_.truth);
    WriteOutcome();
    if (processes_.record_fault().empty()) return 0;
    std::cerr << "plumb: " << processes_.record_fault();
    return 1;
  }

 private:
  /// Before each message, too: the time up to it belongs to what the run was doing until then.
  void Account() {
    progress_.Account(Seconds(clock_.Now() - start_), SecondsSince(really_started_));
  }

  /// While somebody works in virtual time, a tenth of a second of real time has passed.
  bool GoOn() {
    for (const auto& [channel, message] : setting_.virtual_run->TakeStrangers())
      OnStranger(channel, message);
    ShowStatus();
    return !processes_.Ended() && !stopped_from_outside_;
  }

  /// A run in virtual time hears nobody else; but whoever wants it to stop is obeyed.
  void OnStranger(const std::string& channel, const std::vector<uint8_t>& message) {
    const auto request =
        channel == "DRIVER_REQUEST" ? Decoded<driver_request_t>(message) : std::nullopt;
    if (request && (request->request == driver_request_t::DISARM ||
                    request->request == driver_request_t::ESTOP)) {
      stopped_from_outside_ = true;
      requests_.Publish(*request);  // so that whoever has asked is answered
    } else if (channel.starts_with("DRAKE_VIEWER_")) {
      // Who shows the robot says nothing to the run.
    } else if (strange_channels_.size() < kMaxStrangeChannels &&
               strange_channels_.insert(channel).second) {
      Print("plumb: somebody outside the run says " + Printable(channel) +
            ": not heard; --real-time hears everybody");
    }
  }

  // One consent is one attempt. @return 0 when armed, else the exit status.
  int ArmByPerson() {
    const auto until = [&](const std::function<bool()>& so, double seconds) {
      const auto start = SteadyClock::now();
      while (!so() && SecondsSince(start) < seconds && AllRunning()) {
        if (!process_.Wait(kPoll)) return false;
      }
      return so();
    };
    const auto state_is = [&](int8_t state) { return progress_.driver().state == state; };
    if (!until([&] { return state_is(driver_status_t::IDLE); }, 5)) {
      std::cerr << "plumb: the driver is not ready to arm: " << progress_.driver().reason
                << std::endl;
      return process_.stopping() ? 130 : 1;
    }
    // the driver refuses any earlier wish
    until([] { return false; }, robot_.driver.start_guard + 0.1);
    std::cout
        << "The motors of " << robot_.name << " on " << InOneLine(robot_.buses)
        << " will be switched on.\nStand clear, keep the emergency stop at hand, and type 'arm': "
        << std::flush;
    std::string answer;
    while (answer.empty() || answer.back() != '\n') {
      if (!process_.Wait(1'000'000, std::array{STDIN_FILENO})) return 130;
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
    if (stopped_from_outside_) {
      line_.Clear();
      std::cerr << "plumb: somebody outside the run has asked for a stop: the run ends here\n";
      return false;
    }
    Child* const ended = processes_.Ended();
    if (!ended) return true;
    line_.Clear();
    std::cerr << "plumb: " << ended->name() << " ended (" << ended->ending() << "); the end of "
              << ended->log().string() << ":\n"
              << ended->Tail(5) << "plumb: " << GoesOn() << "\n";
    return false;
  }

  std::string GoesOn() const {
    const std::string output = setting_.output.string();
    if (!flags_.policy.empty()) return "nothing was learnt; logs are in " + output;
    return "what was learnt is in " + output +
           ": the same command goes on from there with --output " + output;
  }

  bool KeepArmed() {
    const Rearming::Advice advice =
        rearming_.Next(progress_.driver(), progress_.controller(), clock_.Now());
    for (const std::string& line : advice.lines) Print(line);
    if (advice.arm) Request(driver_request_t::ARM);
    if (advice.give_up)
      std::cerr << "plumb: too many faults without an episode in between" << std::endl;
    return !advice.give_up;
  }

  /// For a person to type.
  std::string ArmCommand() const {
    return "plumb arm --lcm-url '" + process_.lcm_url() + "'" +
           (setting_.virtual_run ? " --clock '" + setting_.virtual_run->coordinator().clock() + "'"
                                 : "") +
           (process_.key_file().empty() ? "" : " --key '" + process_.key_file() + "'");
  }

  void Request(int8_t what) {
    driver_request_t request{};
    request.utime = clock_.Utime();
    request.request = what;
    requests_.Publish(request);
  }

  void WriteOutcome() {
    nlohmann::json summary = progress_.Summary(setting_.truth);
    summary["seed"] = flags_.seed;
    summary["time"] = setting_.virtual_run ? "virtual" : "real";
    if (!setting_.virtual_run) summary["speed"] = clock_.scale();
    summary["bus"] = InOneLine(robot_.buses);
    summary["rearms"] = rearming_.count();
    summary["version"] = VersionLine("plumb");
    if (!flags_.summary.empty()) {
      WriteAtomically(flags_.summary,
                      summary.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
    }
    if (!flags_.report.empty())
      WriteAtomically(flags_.report, LaunchReport(robot_, summary, flags_.command));
  }

  void Print(const std::string& line) {
    line_.Clear();
    std::cout << line << std::endl;
  }
  void ShowStatus() {
    if (SecondsSince(last_status_) < (line_.shown() ? 0.1 : 10)) return;
    last_status_ = SteadyClock::now();
    const std::string line = progress_.StatusLine(SecondsSince(really_started_));
    line_.Show(line);
    if (!line_.shown()) std::cout << line << std::endl;
  }

  Process& process_;
  const LaunchFlags& flags_;
  RunSetting& setting_;
  const RobotDescription& robot_;
  const Clock clock_;
  const int64_t start_;
  Progress progress_;
  Publisher<driver_request_t> requests_;
  Subscriber<driver_status_t> drivers_;
  Subscriber<controller_status_t> controllers_;
  Subscriber<calibration_status_t> calibrations_;
  Subscriber<training_status_t> trainings_;
  const SteadyClock::time_point really_started_ = SteadyClock::now();
  SteadyClock::time_point last_status_ = really_started_;
  ProgressLine line_{true, std::cout};
  Rearming rearming_{flags_.real, ArmCommand(), start_};
  bool stopped_from_outside_ = false;
  std::set<std::string> strange_channels_;
  RunProcesses processes_;  // is stopped first
};

}  // namespace

int Launch(Process& process, const LaunchFlags& flags) {
  RunSetting setting(process, flags);
  if (setting.virtual_run) process.Enter(setting.coordinator()->participant());
  process.TakePart(setting.run);
  return ClosedLoop(process, flags, setting).Run();
}

}  // namespace plumb
