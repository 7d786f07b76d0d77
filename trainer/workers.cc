#include "trainer/workers.h"

#include <signal.h>

#include <algorithm>
#include <utility>

namespace plumb {
namespace {

// Jobs follow each other within microseconds: falling asleep in between would cost more. Some 10 us; for
// longer, a spinning thread would only be in the way of other processes.
constexpr int kSpins = 600;

template <class T>
void WaitWhile(const std::atomic<T>& value, T old) {
  for (int i = 0; i < kSpins; ++i) {
    if (value.load(std::memory_order_acquire) != old) return;
#if defined(__x86_64__)
    __builtin_ia32_pause();
#endif
  }
  value.wait(old, std::memory_order_acquire);
}

}  // namespace

Workers::Workers(int threads) {
  if (threads <= 0) threads = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  for (int worker = 1; worker < threads; ++worker) threads_.emplace_back([this, worker] { Serve(worker); });
}

Workers::~Workers() {
  stopping_ = true;
  ++job_;
  job_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void Workers::Run(int tasks, const std::function<void(int, int)>& work) {
  if (tasks <= 0) return;
  work_ = &work;
  failure_ = nullptr;
  unfinished_ = tasks;
  const uint32_t job = job_ + 1;
  ticket_.store(uint64_t{job} << 32 | static_cast<uint32_t>(tasks), std::memory_order_release);
  job_.store(job, std::memory_order_release);
  if (tasks > 1) job_.notify_all();
  while (DoTask(0)) {
  }
  for (int left = unfinished_; left != 0; left = unfinished_) WaitWhile(unfinished_, left);
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
}

void Workers::Serve(int worker) {
  // Signals are the main thread's business.
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);
  for (uint32_t job = 0; !stopping_; job = job_) {
    while (DoTask(worker)) {
    }
    WaitWhile(job_, job);
  }
}

bool Workers::DoTask(int worker) {
  uint64_t ticket = ticket_.load(std::memory_order_acquire);
  do {
    if (static_cast<uint32_t>(ticket) == 0) return false;
  } while (!ticket_.compare_exchange_weak(ticket, ticket - 1, std::memory_order_acq_rel));
  const int task = static_cast<int>(static_cast<uint32_t>(ticket)) - 1;
  try {
    (*work_)(task, worker);
  } catch (...) {
    const std::lock_guard lock(failure_mutex_);
    if (!failure_ || task < failed_task_) {
      failure_ = std::current_exception();
      failed_task_ = task;
    }
  }
  if (unfinished_.fetch_sub(1, std::memory_order_acq_rel) == 1) unfinished_.notify_all();
  return true;
}

}  // namespace plumb
