#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

namespace plumb {

/// Threads that share the tasks of one job after the other, or of two jobs at a time. A task is
/// first offered to the thread that had it the last time, whose caches hold what it needs; who does
/// it in the end is left to chance. A result that must not depend on it is written per task and
/// summed in the order of tasks.
class Workers {
 public:
  /// @param threads including the caller's; 0 = as many as the machine has.
  explicit Workers(int threads);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  int size() const { return size_; }

  /// Calls work(task, worker) once for each task in [0, tasks), worker in [0, size()), and returns
  /// when all are done. If some throw, the exception of the lowest task is thrown again. By one
  /// thread at a time, but that both of Together's may; not from within itself.
  void Run(int tasks, const std::function<void(int task, int worker)>& work);

  /// Does both, side by side if there are threads for it; each may call Run, and threads with
  /// nothing else to do help either. If both throw, the exception of the first is thrown again. Not
  /// to be called from within itself.
  void Together(const std::function<void()>& first, const std::function<void()>& second);

 private:
  /// The job number in the upper half, the number of unclaimed tasks in the lower: one word, so
  /// that a thread that comes late can never claim a task of a job other than the one it reads of.
  /// A cache line each.
  struct alignas(64) Claims {
    std::atomic<uint64_t> ticket{0};
  };
  struct Job {
    std::unique_ptr<Claims[]> claims;  // one for each worker: a part of the tasks
    std::atomic<int> unfinished{0};    // tasks
    // Of the job; a claimed, unfinished task keeps Run from returning and them from changing.
    int tasks = 0;
    const std::function<void(int, int)>* work = nullptr;
    uint32_t number = 0;
    std::mutex failure_mutex;
    int failed_task = 0;
    std::exception_ptr failure;
  };

  void Serve(int worker);
  void Stop();
  /// Claims a task and does it. @return false if there is none left.
  bool DoTask(Job& job, int worker);
  bool DoAny(int worker);
  void Wake();

  int size_;
  std::vector<std::thread> threads_;
  std::array<Job, 2> jobs_;
  // the second of Together, not begun
  std::atomic<const std::function<void()>*> companion_{nullptr};
  // the threads sleep until it changes
  std::atomic<uint32_t> news_{0};
  std::atomic<bool> stopping_{false};
};

}  // namespace plumb
