#include "common/realtime.h"

#include <fmt/format.h>
#include <malloc.h>
#include <sched.h>
#include <sys/mman.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <array>
#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace plumb {
namespace {

constexpr size_t kStack = size_t{512} * 1024;  // [bytes] far more than a cycle needs

void TouchStack() {
  std::array<volatile unsigned char, kStack> stack;
  const auto page = static_cast<size_t>(sysconf(_SC_PAGESIZE));
  for (size_t i = 0; i < stack.size(); i += page) stack[i] = 0;
}

}  // namespace

void BecomeRealtime(int priority) {
  if (priority == 0) return;
  mallopt(M_TRIM_THRESHOLD, -1);
  mallopt(M_MMAP_MAX, 0);
  const sched_param parameter{.sched_priority = priority};
  if (mlockall(MCL_CURRENT | MCL_FUTURE) != 0 ||
      sched_setscheduler(0, SCHED_FIFO, &parameter) != 0) {
    throw std::runtime_error(fmt::format(
        "--realtime-priority {}: {}; cure: run as root, or allow it with ulimit -r {} and ulimit "
        "-l unlimited",
        priority, std::strerror(errno), priority));
  }
  TouchStack();
}

void BecomeOrdinary() noexcept {
  const sched_param parameter{.sched_priority = 0};
  sched_setscheduler(0, SCHED_OTHER, &parameter);
}

void AddRealtimeFlag(CLI::App& app, int& priority) {
  app.add_option("--realtime-priority", priority, "SCHED_FIFO priority, 0 = off")
      ->check(CLI::Range(0, kHighestPriority))
      ->capture_default_str();
}

}  // namespace plumb
