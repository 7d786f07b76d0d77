#include "drivers/passive_sync.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "common/random.h"

namespace plumb {
namespace {

constexpr int64_t kPeriod = 5000;
constexpr int64_t kStart = 1'700'000'000'000'000;

int64_t One(PassiveSync& sync, int64_t arrival) {
  int64_t time;
  sync.Regularise({&arrival, 1}, {&time, 1});
  return time;
}

/// Exponential delay of the given mean [us].
double Delay(Random& random, double mean) { return -mean * std::log(1 - random.Uniform()); }

struct Errors {
  double worst = 0, rms = 0;
  int64_t lost = 0;
  bool increasing = true;
};

/// Samples measured every (1 + rate) periods, each with a constant and an exponential delay, some lost.
Errors Simulate(double rate, double mean_delay, double loss, uint64_t seed) {
  Random random(seed, {1});
  PassiveSync sync(kPeriod);
  Errors errors;
  int64_t last_arrival = 0, last_time = 0;
  int count = 0;
  for (int k = 0; k < 20'000; ++k) {
    const double truth = static_cast<double>(kPeriod) * k * (1 + rate);
    const double delay = std::min(Delay(random, mean_delay), 0.7 * kPeriod);
    if (random.Uniform() < loss) continue;
    const int64_t arrival = std::max<int64_t>(last_arrival, kStart + std::llround(truth + delay));
    last_arrival = arrival;
    const int64_t time = One(sync, arrival);
    errors.increasing = errors.increasing && time > last_time;
    last_time = time;
    if (k < 200) continue;  // until an early arrival was among them
    const double error = static_cast<double>(time - kStart) - truth;
    errors.worst = std::max(errors.worst, std::abs(error));
    errors.rms += error * error;
    ++count;
  }
  errors.rms = std::sqrt(errors.rms / count);
  errors.lost = sync.lost();
  return errors;
}

TEST_CASE("jitter of arrival does not reach the times of measurement") {
  const double rate = GENERATE(0.0, 1e-4, -1e-4);
  const Errors errors = Simulate(rate, 100, 0, 3);
  INFO("rate error " << rate << ": rms " << errors.rms << " us, worst " << errors.worst << " us");
  CHECK(errors.increasing);
  CHECK(errors.rms < 20);  // an exponential delay of mean 100 has rms 141
  CHECK(errors.worst < 60);
  CHECK(errors.lost == 0);
}

TEST_CASE("lost samples leave gaps, not shifts") {
  const double rate = GENERATE(0.0, 1e-4, -1e-4);
  const Errors errors = Simulate(rate, 100, 0.05, 4);
  CHECK(errors.increasing);
  CHECK(errors.rms < 20);
  CHECK(errors.worst < 60);
  CHECK(errors.lost == Approx(0.05 * 20'000).epsilon(0.1));
}

TEST_CASE("a delay of most of a period is only a delay") {
  PassiveSync sync(kPeriod, 0);
  CHECK(One(sync, kStart) == kStart);
  CHECK(One(sync, kStart + 5000 + 3600) == kStart + 5000);
  CHECK(One(sync, kStart + 10'000 + 20) == kStart + 10'000);
  CHECK(sync.lost() == 0);
}

TEST_CASE("a batch that was held up is told from lost samples") {
  // Three samples kept for 12 ms and delivered together.
  PassiveSync sync(kPeriod, 0);
  CHECK(One(sync, kStart) == kStart);
  const std::vector<int64_t> arrivals = {kStart + 17'000, kStart + 17'010, kStart + 17'020};
  std::vector<int64_t> times(3);
  sync.Regularise(arrivals, times);
  CHECK(times == std::vector<int64_t>{kStart + 5000, kStart + 10'000, kStart + 15'000});
  CHECK(sync.lost() == 0);
  // The same arrival alone means that two were lost.
  PassiveSync other(kPeriod, 0);
  One(other, kStart);
  CHECK(One(other, kStart + 17'000) == kStart + 15'000);
  CHECK(other.lost() == 2);
}

TEST_CASE("a first sample that was late is put right by the next punctual one") {
  PassiveSync sync(kPeriod, 0);
  CHECK(One(sync, kStart + 3000) == kStart + 3000);
  CHECK(One(sync, kStart + 5000) == kStart + 5000);
  CHECK(One(sync, kStart + 10'400) == kStart + 10'000);
}

TEST_CASE("after a long gap and after a step of the clock it starts anew") {
  PassiveSync sync(kPeriod);
  One(sync, kStart);
  One(sync, kStart + 5100);
  const int64_t later = kStart + 3'001'234;
  CHECK(One(sync, later) == later);
  CHECK(sync.resets() == 1);
  const int64_t back = kStart - 3'600'000'000;
  CHECK(One(sync, back) == back);
  CHECK(sync.resets() == 2);
  CHECK(One(sync, back + 5050) == Approx(back + 5000).margin(10));
}

TEST_CASE("times increase strictly whatever arrives") {
  Random random(5, {2});
  PassiveSync sync(kPeriod);
  int64_t arrival = kStart, last = 0;
  for (int i = 0; i < 10'000; ++i) {
    arrival += static_cast<int64_t>(random.Bits() % 12'000) - 4000;
    const int64_t time = One(sync, arrival);
    REQUIRE(time > last);
    last = time;
    arrival = std::max(arrival, time - 500'000);
  }
}

}  // namespace
}  // namespace plumb
