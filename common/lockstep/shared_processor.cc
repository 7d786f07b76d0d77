#include "common/lockstep/shared_processor.h"

#include <sys/syscall.h>
#include <unistd.h>

#include <fstream>
#include <random>

namespace plumb {
namespace {

constexpr auto kPeriod = std::chrono::seconds(1);
constexpr double kCrowded = 0.2;  // share of the time for which we wait for others, ready to run

/// [ns] for which this thread has waited, ready to run.
long long Waited() {
  std::ifstream file("/proc/thread-self/schedstat");
  long long ran = 0, waited = 0;
  file >> ran >> waited;
  return waited;
}

/// @param policy SCHED_BATCH: whoever is woken waits until the one who wakes it has gone to sleep,
/// which is what it does next. With SCHED_OTHER it would be interrupted for that, and have to be
/// resumed later.
void Bind(pid_t pid, const cpu_set_t& processors, int policy) {
  const sched_param none{};
  sched_setscheduler(pid, policy, &none);
  sched_setaffinity(pid, sizeof processors, &processors);
}

}  // namespace

SharedProcessor::SharedProcessor() : self_(static_cast<pid_t>(syscall(SYS_gettid))) {
  if (sched_getaffinity(0, sizeof allowed_, &allowed_) != 0) CPU_ZERO(&allowed_);
}

SharedProcessor::~SharedProcessor() {
  if (processor_ < 0) return;
  Release(self_);
  for (const pid_t pid : others_) Release(pid);
}

void SharedProcessor::Add(pid_t pid) {
  if (CPU_COUNT(&allowed_) < 2) return;
  others_.insert(pid);
  Choose(processor_ < 0 ? sched_getcpu() : processor_);
}

void SharedProcessor::Remove(pid_t pid) { others_.erase(pid); }

void SharedProcessor::Release(pid_t pid) const {
  if (CPU_COUNT(&allowed_) > 0) Bind(pid, allowed_, SCHED_OTHER);
}

void SharedProcessor::Choose(int processor) {
  if (processor < 0) return;
  processor_ = processor;
  cpu_set_t one;
  CPU_ZERO(&one);
  CPU_SET(processor, &one);
  Bind(self_, one, SCHED_BATCH);
  for (const pid_t pid : others_) Bind(pid, one, SCHED_BATCH);
}

void SharedProcessor::Balance() {
  const auto now = std::chrono::steady_clock::now();
  if (processor_ < 0 || now - looked_ < kPeriod) return;
  const long long waited = Waited();
  const double share =
      static_cast<double>(waited - waited_) /
      static_cast<double>(
          std::chrono::duration_cast<std::chrono::nanoseconds>(now - looked_).count());
  const bool first = looked_ == std::chrono::steady_clock::time_point{};
  looked_ = now;
  waited_ = waited;
  if (first || share < kCrowded) return;
  // Another one may be as crowded, or chosen by other runs, too: any will do, for a second.
  static thread_local std::minstd_rand random(std::random_device{}());
  int next = static_cast<int>(random() % static_cast<unsigned>(CPU_COUNT(&allowed_)));
  for (int processor = 0; processor < CPU_SETSIZE; ++processor) {
    if (CPU_ISSET(processor, &allowed_) && next-- == 0) return Choose(processor);
  }
}

}  // namespace plumb
