#include "trainer/workers.h"

#include <signal.h>

#include <algorithm>
#include <utility>

#include "common/shares.h"
#include "common/thread_count.h"

namespace plumb {
namespace {

// Jobs follow each other within microseconds: falling asleep in between would cost more. Some 10
// us; for longer, a spinning thread would only be in the way of other processes.
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

// The place of a thread in the Workers that it serves: in all others it is the caller, worker 0.
// The job that it gives out is the second one within Together's second.
struct Role {
  const Workers* workers = nullptr;
  int worker = 0, job = 0;
};
thread_local Role role;

Role RoleIn(const Workers* workers) { return role.workers == workers ? role : Role{}; }

}  // namespace

Workers::Workers(int threads) : size_(ThreadCount(threads)) {
  for (Job& job : jobs_) job.claims = std::make_unique<Claims[]>(static_cast<size_t>(size_));
  try {
    for (int worker = 1; worker < size_; ++worker)
      threads_.emplace_back([this, worker] { Serve(worker); });
  } catch (...) {  // the system has no more threads
    Stop();
    throw;
  }
}

Workers::~Workers() { Stop(); }

void Workers::Stop() {
  stopping_ = true;
  Wake();
  for (std::thread& thread : threads_) thread.join();
}

void Workers::Wake() {
  ++news_;
  news_.notify_all();
}

void Workers::Run(int tasks, const std::function<void(int, int)>& work) {
  if (tasks <= 0) return;
  const auto [self, worker, index] = RoleIn(this);
  Job& job = jobs_[static_cast<size_t>(index)];
  job.work = &work;
  job.tasks = tasks;
  job.failure = nullptr;
  job.unfinished = tasks;
  ++job.number;
  for (int w = 0; w < size(); ++w) {
    const int share = ShareBegin(tasks, w + 1, size()) - ShareBegin(tasks, w, size());
    job.claims[static_cast<size_t>(w)].ticket.store(
        uint64_t{job.number} << 32 | static_cast<uint32_t>(share), std::memory_order_release);
  }
  if (tasks > 1) Wake();
  while (DoTask(job, worker)) {
  }
  for (int left = job.unfinished; left != 0; left = job.unfinished) WaitWhile(job.unfinished, left);
  if (job.failure) std::rethrow_exception(std::exchange(job.failure, nullptr));
}

void Workers::Together(const std::function<void()>& first, const std::function<void()>& second) {
  std::exception_ptr failures[2];
  const auto guarded = [](const std::function<void()>& what, std::exception_ptr& failure) {
    try {
      what();
    } catch (...) {
      failure = std::current_exception();
    }
  };
  std::atomic<bool> done{false};
  const std::function<void()> companion = [&, this] {
    Workers* const self = this;  // once it is done, this function may be gone
    const Role before = std::exchange(role, {self, RoleIn(self).worker, 1});
    guarded(second, failures[1]);
    role = before;
    done.store(true, std::memory_order_release);
    self->Wake();
  };
  companion_.store(&companion, std::memory_order_release);
  if (size() > 1) Wake();
  guarded(first, failures[0]);
  for (;;) {
    const uint32_t seen = news_;
    if (const auto* own = companion_.exchange(nullptr)) (*own)();  // nobody had the time
    if (done.load(std::memory_order_acquire)) break;
    if (!DoAny(0)) WaitWhile(news_, seen);
  }
  for (std::exception_ptr& failure : failures) {
    if (failure) std::rethrow_exception(failure);
  }
}

void Workers::Serve(int worker) {
  // Signals are the main thread's business.
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, nullptr);
  role = {this, worker, 0};
  for (;;) {
    const uint32_t seen = news_;  // before what the news may be of: whoever stops wakes once
    if (stopping_) return;
    if (const auto* companion = companion_.exchange(nullptr)) (*companion)();
    if (!DoAny(worker) && news_ == seen) WaitWhile(news_, seen);
  }
}

bool Workers::DoAny(int worker) {
  bool any = false;
  for (Job& job : jobs_) {
    while (DoTask(job, worker)) any = true;
  }
  return any;
}

bool Workers::DoTask(Job& job, int worker) {
  for (int i = 0; i < size(); ++i) {
    const int from = (worker + i) % size();
    std::atomic<uint64_t>& claims = job.claims[static_cast<size_t>(from)].ticket;
    uint64_t ticket = claims.load(std::memory_order_acquire);
    bool claimed = false;
    while (static_cast<uint32_t>(ticket) != 0 && !claimed) {
      claimed = claims.compare_exchange_weak(ticket, ticket - 1, std::memory_order_acq_rel);
    }
    if (!claimed) continue;
    const int task =
        ShareBegin(job.tasks, from, size()) + static_cast<int>(static_cast<uint32_t>(ticket)) - 1;
    try {
      (*job.work)(task, worker);
    } catch (...) {
      const std::lock_guard lock(job.failure_mutex);
      if (!job.failure || task < job.failed_task) {
        job.failure = std::current_exception();
        job.failed_task = task;
      }
    }
    if (job.unfinished.fetch_sub(1, std::memory_order_acq_rel) == 1) job.unfinished.notify_all();
    return true;
  }
  return false;
}

}  // namespace plumb
