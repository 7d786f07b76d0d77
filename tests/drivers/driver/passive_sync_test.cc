#include "drivers/driver/passive_sync.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "common/random.h"

namespace plumb {
namespace {

constexpr int64_t kPeriod = 5000;
constexpr int64_t kStart = 1'700'000'000'000'000;

using Times = std::vector<int64_t>;

/// Passes arrivals one by one, as they would come, and collects the times as they are given.
struct Feed {
  explicit Feed(double rate_error = 1e-4) : sync(kPeriod, rate_error) {}

  Times Add(Times arrivals) {
    waiting.insert(waiting.end(), arrivals.begin(), arrivals.end());
    Times times(waiting.size());
    times.resize(sync.Regularise(waiting, times));
    waiting.erase(waiting.begin(), waiting.begin() + static_cast<std::ptrdiff_t>(times.size()));
    return times;
  }

  PassiveSync sync;
  Times waiting;
};

/// Exponential delay of the given mean [us].
double Delay(Random& random, double mean) { return -mean * std::log(1 - random.Uniform()); }

struct Errors {
  double worst = 0, rms = 0;
  int64_t lost = 0;
  bool increasing = true;
};

/// Samples measured every (1 + rate) periods, each with a constant and an exponential delay, some
/// lost.
Errors Simulate(double rate, double mean_delay, double loss, uint64_t seed) {
  Random random(seed, {1});
  Feed feed;
  Errors errors;
  int64_t last_arrival = 0, last_time = 0;
  int count = 0;
  std::vector<double> truths;  // of the samples that have no time yet
  for (int k = 0; k < 20'000; ++k) {
    const double truth = static_cast<double>(kPeriod) * k * (1 + rate);
    const double delay = std::min(Delay(random, mean_delay), 0.7 * kPeriod);
    if (random.Uniform() < loss) continue;
    const int64_t arrival = std::max<int64_t>(last_arrival, kStart + std::llround(truth + delay));
    last_arrival = arrival;
    truths.push_back(truth);
    for (const int64_t time : feed.Add({arrival})) {
      errors.increasing = errors.increasing && time > last_time;
      last_time = time;
      const double error = static_cast<double>(time - kStart) - truths.front();
      truths.erase(truths.begin());
      if (k < 200) continue;  // until an early arrival was among them
      errors.worst = std::max(errors.worst, std::abs(error));
      errors.rms += error * error;
      ++count;
    }
  }
  errors.rms = std::sqrt(errors.rms / count);
  errors.lost = feed.sync.lost();
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
  Feed feed(0);
  CHECK(feed.Add({kStart}) == Times{kStart});
  CHECK(feed.Add({kStart + 5000 + 4300}) == Times{kStart + 5000});
  CHECK(feed.Add({kStart + 10'000 + 20}) == Times{kStart + 10'000});
  CHECK(feed.sync.lost() == 0);
}

TEST_CASE("samples that were held up are told from lost ones by what comes behind") {
  Feed feed(0);
  CHECK(feed.Add({kStart}) == Times{kStart});
  // 17 ms late: the first of them waits, whether the others are read together with it or not.
  CHECK(feed.Add({kStart + 22'000}).empty());
  CHECK(feed.Add({kStart + 22'010, kStart + 22'020}).empty());
  CHECK(feed.Add({kStart + 22'030}) ==
        Times{kStart + 5000, kStart + 10'000, kStart + 15'000, kStart + 20'000});
  CHECK(feed.Add({kStart + 29'800}).empty());  // alone, nearly a period late
  CHECK(feed.Add({kStart + 30'001}) == Times{kStart + 25'000, kStart + 30'000});
  CHECK(feed.sync.lost() == 0);

  SECTION("one loss: five samples agree") {
    for (int k = 8; k < 12; ++k) CHECK(feed.Add({kStart + 5000 * k + 10}).empty());
    CHECK(feed.Add({kStart + 60'010}) == Times{kStart + 40'000, kStart + 45'000, kStart + 50'000,
                                               kStart + 55'000, kStart + 60'000});
    CHECK(feed.Add({kStart + 65'020}) == Times{kStart + 65'000});
    CHECK(feed.sync.lost() == 1);
  }
  SECTION("several losses in a row") {
    CHECK(feed.Add({kStart + 60'010, kStart + 65'020, kStart + 70'030, kStart + 75'020,
                    kStart + 80'020})
              .size() == 5);
    CHECK(feed.sync.lost() == 5);
  }
  SECTION("held up twice in a row, ever later") {
    CHECK(feed.Add({kStart + 42'000}).empty());
    CHECK(feed.Add({kStart + 53'000}).empty());
    CHECK(feed.Add({kStart + 53'010, kStart + 53'020}) ==
          Times{kStart + 35'000, kStart + 40'000, kStart + 45'000, kStart + 50'000});
  }
}

TEST_CASE("a first sample that was late is put right by the next punctual one") {
  Feed feed(0);
  CHECK(feed.Add({kStart + 3000}) == Times{kStart + 3000});
  CHECK(feed.Add({kStart + 5000}) == Times{kStart + 5000});
  CHECK(feed.Add({kStart + 10'400}) == Times{kStart + 10'000});
}

TEST_CASE("after a long gap and after a step of the clock it starts anew") {
  Feed feed;
  feed.Add({kStart, kStart + 5100});
  // Silence, then three samples of which two were held up, then regular ones.
  const int64_t later = kStart + 3'001'234;
  CHECK(feed.Add({later, later + 10, later + 20, later + 5100, later + 10'030}).empty());
  const Times times = feed.Add({later + 18'000});
  REQUIRE(times.size() == 6);
  for (int k = 0; k < 6; ++k)
    CHECK(times[static_cast<size_t>(k)] == Approx(later + 20 + 5000 * (k - 2)).margin(10));
  CHECK(feed.sync.resets() == 1);

  const int64_t back = kStart - 3'600'000'000;
  CHECK(feed.Add({back, back + 5050, back + 10'000, back + 15'000}).empty());
  CHECK(feed.Add({back + 20'000}).at(0) == Approx(back).margin(10));
  CHECK(feed.sync.resets() == 2);
}

TEST_CASE("a clock that is set back by little is followed, too") {
  const int64_t step = GENERATE(-20'000, -300'000, -999'000);
  Feed feed;
  Times times;
  for (int k = 0; k < 40; ++k) {
    const Times more = feed.Add({kStart + 5000 * k + (k < 20 ? 0 : step)});
    times.insert(times.end(), more.begin(), more.end());
  }
  REQUIRE(times.size() == 40);
  for (int k = 0; k < 40; ++k) {
    CHECK(times[static_cast<size_t>(k)] ==
          Approx(kStart + 5000 * k + (k < 20 ? 0 : step)).margin(20));
  }
  CHECK(feed.sync.resets() == 1);
}

TEST_CASE("times increase strictly whatever arrives") {
  Random random(5, {2});
  Feed feed;
  int64_t arrival = kStart, last = 0;
  for (int i = 0; i < 10'000; ++i) {
    arrival += static_cast<int64_t>(random.Bits() % 12'000) - 4000;
    for (const int64_t time : feed.Add({arrival})) {
      REQUIRE(time > last);
      last = time;
    }
    REQUIRE(feed.waiting.size() < PassiveSync::kMaxWaiting);
    arrival = std::max(arrival, last - 500'000);
  }
}

}  // namespace
}  // namespace plumb
