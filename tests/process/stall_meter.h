#pragma once

#include <atomic>
#include <chrono>
#include <thread>

namespace plumb {

/// What the machine does to somebody who only sleeps: by how much a bare timer of a millisecond
/// comes late, at worst. A test in real time can tell nothing of us where that is more than what we
/// are given. Ends with its destruction.
class StallMeter {
 public:
  StallMeter() : thread_([this] { Measure(); }) {}
  ~StallMeter() {
    ended_ = true;
    thread_.join();
  }

  /// [ms] since it was made.
  double worst() const { return worst_; }

 private:
  void Measure() {
    using Clock = std::chrono::steady_clock;
    constexpr auto kPeriod = std::chrono::milliseconds(1);
    while (!ended_) {
      const auto begin = Clock::now();
      std::this_thread::sleep_for(kPeriod);
      const double late =
          std::chrono::duration<double, std::milli>(Clock::now() - begin - kPeriod).count();
      if (late > worst_) worst_ = late;
    }
  }

  std::atomic<bool> ended_ = false;
  std::atomic<double> worst_ = 0;
  std::thread thread_;
};

}  // namespace plumb
