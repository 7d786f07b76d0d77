#pragma once

#include <atomic>
#include <chrono>
#include <thread>

namespace plumb {

/// Measures how late a bare timer of a millisecond comes on this machine, at worst, until it is
/// destroyed. Where that exceeds the deadline of a test in real time, the test says nothing about
/// us.
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
