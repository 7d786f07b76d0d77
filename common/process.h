#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <string>

#include "common/clock.h"
#include "common/messenger.h"

namespace plumb {

/// What every Plumbline process has: flags, a log, a clock, a stop signal, a connection to LCM.
///
///   int main(int argc, char** argv) {
///     return plumb::Run("plumb-estimator", "what it does", argc, argv,
///                       [&](CLI::App& app) { app.add_option(...); },
///                       [&](plumb::Process& process) { ...; return 0; });
///   }
class Process {
 public:
  Process(std::string name, std::string lcm_url, const std::string& clock);

  const std::string& name() const { return name_; }
  const Clock& clock() const { return clock_; }
  /// Opens LCM on first use. @throws std::runtime_error with the cure.
  Messenger& messenger();
  const std::string& lcm_url() const { return lcm_url_; }

  /// Becomes readable when the process is asked to stop (SIGINT, SIGTERM, SIGHUP). For ppoll.
  int stop_fd() const { return stop_fd_; }
  /// True once the process has been asked to stop. Never blocks.
  bool stopping();
  /// Sleeps until LCM has messages, `fd` (if not -1) is readable, the process is asked to stop, or `timeout`
  /// scaled microseconds have passed. Then drains LCM. @return false when the process is asked to stop.
  bool Wait(int64_t timeout, int fd = -1);

 private:
  std::string name_;
  std::string lcm_url_;
  Clock clock_;
  int stop_fd_;
  bool stopping_ = false;
  std::unique_ptr<Messenger> messenger_;
};

/// "plumb-driver 0.1.0 (3f2a9c1, clean)"
std::string VersionLine(const std::string& name);

/// Parses the flags (the common ones and `add_flags`), starts the log, blocks the stop signals, runs `body`,
/// and turns any exception into one clear line and exit status 1. Usage errors exit with 2.
int Run(const std::string& name, const std::string& description, int argc, char** argv,
        const std::function<void(CLI::App&)>& add_flags, const std::function<int(Process&)>& body);

}  // namespace plumb
