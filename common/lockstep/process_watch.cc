#include "common/lockstep/process_watch.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <sstream>

namespace plumb {
namespace {

constexpr double kComputing = 60;  // [s] that nobody wonders about

using Seconds = std::chrono::duration<double>;

struct ProcessState {
  char state = '?';  // as in /proc/PID/stat
  long ticks = 0;    // of processor time
};

ProcessState StateOf(pid_t pid) {
  std::ifstream file(fmt::format("/proc/{}/stat", pid));
  std::string line;
  std::getline(file, line);
  ProcessState result;
  const size_t name_end = line.rfind(')');  // the name may contain anything
  if (name_end == std::string::npos) return result;
  std::istringstream fields(line.substr(name_end + 1));
  std::string ignored;
  fields >> result.state;
  for (int i = 0; i < 10; ++i) fields >> ignored;  // up to the 13th field
  long user = 0, system = 0;
  fields >> user >> system;
  result.ticks = user + system;
  return result;
}

/// Where in the kernel it sleeps; empty if the kernel does not tell.
std::string SleepsIn(pid_t pid) {
  std::ifstream file(fmt::format("/proc/{}/wchan", pid));
  std::string where;
  std::getline(file, where);
  return where == "0" ? "" : where;
}

}  // namespace

void ProcessWatch::Begin() {
  begin_ = moved_ = Clock::now();
  next_note_ = kFirstNote;
}

std::string ProcessWatch::Look() {
  const ProcessState process = StateOf(pid_);
  const bool stopped = process.state == 'T' || process.state == 't';
  const Clock::time_point now = Clock::now();
  if (stopped || process.ticks != ticks_) moved_ = now;
  ticks_ = process.ticks;
  const double waited = Seconds(now - begin_).count();
  const bool computes = !stopped && idle() < 1;
  if (waited < (computes ? std::max(next_note_, kComputing) : next_note_)) return {};
  next_note_ = 2 * waited;
  if (stopped) return fmt::format("stopped by a signal, waited for since {:.0f} s", waited);
  if (computes) return fmt::format("computing since {:.0f} s", waited);
  const std::string where = SleepsIn(pid_);
  return fmt::format("asleep{}{}, waited for since {:.0f} s", where.empty() ? "" : " in ", where,
                     waited);
}

bool ProcessWatch::dead() const {
  const char state = StateOf(pid_).state;
  return state == '?' || state == 'Z' || state == 'X';
}

double ProcessWatch::idle() const { return Seconds(Clock::now() - moved_).count(); }

}  // namespace plumb
