#include "common/process.h"

#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/spdlog.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/signalfd.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <iostream>
#include <limits>
#include <memory>
#include <stdexcept>
#include <vector>

#include "common/lcm_url.h"
#include "common/nearest_name.h"
#include "common/outside_text.h"
#include "common/process_log.h"
#include "common/process_output.h"
#include "common/program_version.h"
#include "common/realtime.h"
#include "common/service_notice.h"
#include "common/time_units.h"

namespace plumb {
namespace {

constexpr std::string_view kVirtual = "virtual:";

/// The service manager is the whole process's, as its log is. In real time only: virtual time may
/// stand still for as long as somebody computes.
ServiceNotice& Notice() {
  static ServiceNotice notice;
  return notice;
}

// Hanging up stops nobody who was started to outlive it, as nohup starts a program: blocked, an
// ignored signal would still reach us.
std::vector<int> FindStopSignals() {
  struct sigaction hangup {};
  sigaction(SIGHUP, nullptr, &hangup);
  if (hangup.sa_handler == SIG_IGN) return {SIGINT, SIGTERM};
  return {SIGINT, SIGTERM, SIGHUP};
}

const std::vector<int>& StopSignals() {
  static const std::vector<int> signals = FindStopSignals();
  return signals;
}

sigset_t SetOfStopSignals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : StopSignals()) sigaddset(&set, signal);
  return set;
}

int BlockStopSignals() {
  const sigset_t set = SetOfStopSignals();
  // Before any thread exists (LCM starts one), so that all of them inherit the mask.
  sigprocmask(SIG_BLOCK, &set, nullptr);
  ::signal(SIGPIPE, SIG_IGN);
  // A file that may not grow is an error with its name, as a full disk is.
  ::signal(SIGXFSZ, SIG_IGN);
  // Or nobody would ever hear that a child has ended, where our parent ignores his.
  ::signal(SIGCHLD, SIG_DFL);
  const int fd = signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
  if (fd < 0) throw std::runtime_error("signalfd failed");
  return fd;
}

}  // namespace

Process::Process(std::string name, const std::string& lcm_url, const std::string& clock)
    : name_(std::move(name)),
      lcm_url_(ResolvedLcmUrl(lcm_url)),
      stop_fd_(BlockStopSignals()),
      joined_(clock.starts_with(kVirtual) ? JoinRun(clock.substr(kVirtual.size()), name_)
                                          : nullptr),
      participant_(joined_.get()),
      clock_(joined_ ? Clock(joined_->time()) : Clock::Parse(clock)) {}

void Process::Enter(Participant& participant) {
  participant_ = &participant;
  clock_ = Clock(participant.time());
}

void Process::UseKey(const std::string& file) {
  key_file_ = file;
  key_.emplace(file);
}

Messenger& Process::messenger() {
  if (!messenger_) {
    messenger_ = participant_ ? std::make_unique<Messenger>(*participant_)
                              : std::make_unique<Messenger>(lcm_url_);
    const auto reach = participant_               ? Identity::Reach::kRun
                       : StaysOnMachine(lcm_url_) ? Identity::Reach::kMachine
                                                  : Identity::Reach::kNetwork;
    messenger_->Become(Identity(name_, key_, clock_, reach, run_));
  }
  return *messenger_;
}

void Process::EndAtOnce() {
  for (const int signal : StopSignals()) ::signal(signal, [](int) { _exit(130); });
  const sigset_t set = SetOfStopSignals();
  sigprocmask(SIG_UNBLOCK, &set, nullptr);
}

bool Process::stopping() {
  signalfd_siginfo info;
  if (read(stop_fd_, &info, sizeof info) == sizeof info) {
    stopping_ = true;
    if (!participant_) Notice().Stopping();
  }
  return stopping_ || (participant_ && participant_->stopping());
}

void Process::Doze(int64_t timeout, std::span<const int> fds) {
  if (participant_) {
    return participant_->Wait(participant_->now() + timeout, Participant::Wake::kWhenHeard,
                              stop_fd_);
  }
  polled_.clear();
  for (const int fd : {stop_fd_, messenger().fd()}) polled_.push_back({fd, POLLIN, 0});
  for (const int fd : fds) polled_.push_back({fd, POLLIN, 0});
  const timespec real = clock_.RealDuration(timeout);
  Notice().Alive();
  ppoll(polled_.data(), polled_.size(), &real, nullptr);
}

/// In real time all that has arrived by now, or whoever computes for long between two turns would
/// be late for ever after a flood.
void Process::Hear() {
  if (participant_) {
    messenger().Drain();
    return;
  }
  messenger().Drain(std::numeric_limits<int>::max());
  for (const auto& [channel, messages] : messenger().TakeLosses()) {
    spdlog::warn("{}: {} messages lost, they came faster than they were dealt with", channel,
                 messages);
  }
}

bool Process::Wait(int64_t timeout, std::span<const int> fds) {
  Doze(timeout, fds);
  Hear();
  return !stopping();
}

bool Process::Sleep(int64_t timeout, const std::function<void()>& meanwhile) {
  if (participant_) {
    participant_->Wait(participant_->now() + timeout, Participant::Wake::kOnTime, stop_fd_,
                       meanwhile);
  } else {
    const int64_t end = clock_.Now() + timeout;
    if (meanwhile) meanwhile();
    pollfd stop{stop_fd_, POLLIN, 0};
    Notice().Alive();
    const timespec real = clock_.RealDuration(std::max<int64_t>(end - clock_.Now(), 0));
    ppoll(&stop, 1, &real, nullptr);
  }
  Hear();
  return !stopping();
}

void Process::BeAlone(const std::string& robot) {
  if (participant_ || !lcm_url_.starts_with("udpm:")) return;  // others have messages of their own
  alone_.emplace(fmt::format("{} of {} on {}", name_, robot, LcmGroup(lcm_url_)),
                 fmt::format("another {} of {} is at work on {}: end it, or give another --lcm-url",
                             name_, robot, lcm_url_));
}

void Process::BecomeFast(int priority) {
  if (participant_) {
    participant_->ShareProcessor();
  } else {
    BecomeRealtime(priority);
  }
}

void Process::TakeVirtualTime(double seconds) {
  if (!participant_ || seconds == 0) return;
  const int64_t end = participant_->now() + Microseconds(seconds);
  while (participant_->now() < end && !stopping())
    participant_->Wait(end, Participant::Wake::kOnTime, stop_fd_);
}

std::string VersionLine(const std::string& name) { return name + " " + ProgramVersion(); }

namespace {

// CLI11 says no more than that there must be one.
void SuggestCommand(const CLI::App& app) {
  const std::vector<std::string> unknown = app.remaining();
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(command->get_name());
  if (names.empty() || unknown.empty() || !app.get_subcommands().empty()) return;
  std::cerr << fmt::format("{} has no command '{}'; the nearest is '{}'\n", app.get_name(),
                           unknown.front(), NearestName(unknown.front(), names));
}

// @return exit status.
int ParseAndRun(const std::string& name, const std::string& description, int argc, char** argv,
                const std::function<void(CLI::App&)>& add_flags,
                const std::function<int(Process&)>& body) {
  const PrintableStream out(std::cout), err(std::cerr);
  CLI::App app{description, name};
  std::string lcm_url = ResolvedLcmUrl("");
  std::string clock = "1";
  std::string level = "info";
  std::string key;
  int64_t run = 0;
  int parent = 0;
  int niceness = 0;
  app.add_option("--lcm-url", lcm_url,
                 "LCM provider; default: $LCM_DEFAULT_URL or this machine only")
      ->capture_default_str();
  app.add_option("--clock", clock,
                 "clock scale, or SCALE@EPOCH or virtual:PATH as plumb launch passes it")
      ->capture_default_str();
  app.add_option("--key", key,
                 "sign what is said on LCM with this key, and believe nothing else; stopping needs "
                 "none (plumb key makes one)");
  app.add_option("--run", run, "the run that this process is part of, as plumb launch numbers it");
  app.add_option("--log-level", level, "log nothing less important than this")
      ->check(CLI::IsMember({"trace", "debug", "info", "warning", "error"}))
      ->capture_default_str();
  app.add_option("--parent", parent, "stop when this process, which started us, is gone");
  app.add_option("--nice", niceness, "give way to the others: 0 to 19")->check(CLI::Range(0, 19));
  app.set_version_flag("--version", VersionLine(name));
  if (add_flags) add_flags(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const int status = app.exit(error);
    if (status != 0) SuggestCommand(app);
    return status == 0 ? 0 : 2;
  }
  spdlog::set_default_logger(
      std::make_shared<spdlog::logger>(name, std::make_shared<LimitedSink>()));
  spdlog::set_formatter(std::make_unique<PrintableFormatter>(
      std::make_unique<spdlog::pattern_formatter>("%H:%M:%S.%e %n %^%l%$ %v")));
  spdlog::set_level(spdlog::level::from_str(level));
  try {
    if (parent != 0) {
      prctl(PR_SET_PDEATHSIG, SIGTERM);
      if (getppid() != parent) return 0;  // it died before we could ask to be told
    }
    if (niceness != 0) setpriority(PRIO_PROCESS, 0, niceness);
    Process process(name, lcm_url, clock);
    if (!key.empty()) process.UseKey(key);
    process.TakePart(run);
    spdlog::debug("{}", VersionLine(name));
    return body(process);
  } catch (const std::exception& error) {
    spdlog::error("{}", error.what());
    return 1;
  }
}

}  // namespace

int Run(const std::string& name, const std::string& description, int argc, char** argv,
        const std::function<void(CLI::App&)>& add_flags, const std::function<int(Process&)>& body) {
  const WriteErrors printed(std::cout);
  const int status = ParseAndRun(name, description, argc, argv, add_flags, body);
  // Whoever closes a pipe, as `| head` does, has what he wants.
  if (printed.first() == 0 || printed.first() == EPIPE) return status;
  std::cerr << fmt::format("{}: standard output cannot be written: {}\n", name,
                           std::strerror(printed.first()));
  return 1;
}

}  // namespace plumb
