#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace plumb {

/// Threads that share the tasks of one job after the other. Which thread does which task is left to chance; a
/// result that must not depend on it is written per task and summed in the order of tasks.
/// One job at a time: Run is not thread-safe.
class Workers {
 public:
  /// @param threads including the caller's; 0 = as many as the machine has.
  explicit Workers(int threads);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  int size() const { return static_cast<int>(threads_.size()) + 1; }

  /// Calls work(task, worker) once for each task in [0, tasks), worker in [0, size()), and returns when all
  /// are done. If some throw, the exception of the lowest task is thrown again.
  void Run(int tasks, const std::function<void(int task, int worker)>& work);

 private:
  void Serve(int worker);
  /// Claims a task and does it. @return false if there is none left.
  bool DoTask(int worker);

  std::vector<std::thread> threads_;
  // The job's number in the upper half, the number of unclaimed tasks in the lower: one word, so that a
  // thread that comes late can never claim a task of a job other than the one it reads of.
  std::atomic<uint64_t> ticket_{0};
  std::atomic<uint32_t> job_{0};    // the threads sleep until it changes
  std::atomic<int> unfinished_{0};  // tasks
  std::atomic<bool> stopping_{false};
  // Of the job; a claimed, unfinished task keeps Run from returning and them from changing.
  const std::function<void(int, int)>* work_ = nullptr;
  std::mutex failure_mutex_;
  int failed_task_ = 0;
  std::exception_ptr failure_;
};

}  // namespace plumb
