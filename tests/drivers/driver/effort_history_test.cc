#include "drivers/driver/effort_history.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>

#include "common/random.h"

namespace plumb {
namespace {

std::array<double, 2> Average(const EffortHistory& history, int64_t from, int64_t to) {
  std::array<double, 2> average;
  history.Average(from, to, average);
  return average;
}

void Record(EffortHistory& history, int64_t utime, double a, double b) {
  const std::array<double, 2> effort{a, b};
  history.Record(utime, effort);
}

TEST_CASE("averages of a staircase") {
  EffortHistory history(2, 8);
  CHECK(std::isnan(Average(history, 0, 10)[0]));
  Record(history, 100, 1, -1);
  Record(history, 200, 3, 0);
  Record(history, 250, -2, 4);
  CHECK(Average(history, 100, 200)[0] == Approx(1));
  CHECK(Average(history, 150, 225)[0] == Approx((50 * 1 + 25 * 3) / 75.0));
  CHECK(Average(history, 100, 300)[0] == Approx((100 * 1 + 50 * 3 + 50 * -2) / 200.0));
  CHECK(Average(history, 100, 300)[1] == Approx((100 * -1 + 0 + 50 * 4) / 200.0));
  CHECK(Average(history, 260, 1000)[1] == Approx(4));  // the last setpoint holds
  CHECK(std::isnan(Average(history, 99, 200)[0]));     // before the first
  CHECK(std::isnan(Average(history, 200, 200)[0]));
  CHECK(std::isnan(Average(history, 200, 150)[0]));
}

TEST_CASE("the effort at a time, whatever comes later") {
  EffortHistory history(2, 8);
  std::array<double, 2> effort{};
  history.At(100, effort);
  CHECK(std::isnan(effort[0]));
  Record(history, 100, 1, -1);
  Record(history, 200, 3, 0);
  history.At(99, effort);
  CHECK(std::isnan(effort[1]));
  history.At(100, effort);
  CHECK(effort == std::array<double, 2>{1, -1});
  history.At(199, effort);
  CHECK(effort == std::array<double, 2>{1, -1});
  history.At(5000, effort);
  CHECK(effort == std::array<double, 2>{3, 0});
}

TEST_CASE("the ring forgets the oldest, and everything when time goes back") {
  EffortHistory history(2, 4);
  for (int i = 0; i < 10; ++i) Record(history, 100 * i, i, 0);
  CHECK(std::isnan(Average(history, 599, 700)[0]));
  CHECK(Average(history, 600, 1000)[0] == Approx(7.5));
  Record(history, 300, 5, 0);
  CHECK(std::isnan(Average(history, 250, 400)[0]));
  CHECK(Average(history, 300, 400)[0] == Approx(5));
}

TEST_CASE("averages equal the closed form for random staircases") {
  Random random(7, {1});
  EffortHistory history(2, 64);
  // Antiderivative of the staircase at every step, by independent summation.
  std::array<int64_t, 64> time{};
  std::array<double, 64> level{}, integral{};
  for (size_t i = 0; i < 64; ++i) {
    time[i] = i == 0 ? 1'700'000'000'000'000 : time[i - 1] + 1 + random.Bits() % 9000;
    level[i] = random.Uniform(-2, 2);
    integral[i] =
        i == 0 ? 0 : integral[i - 1] + level[i - 1] * static_cast<double>(time[i] - time[i - 1]);
    Record(history, time[i], level[i], -level[i]);
  }
  const auto antiderivative = [&](int64_t t) {
    size_t i = 63;
    while (time[i] > t) --i;
    return integral[i] + level[i] * static_cast<double>(t - time[i]);
  };
  for (int trial = 0; trial < 1000; ++trial) {
    const int64_t span = time[63] - time[0] + 5000;
    const int64_t from =
        time[0] + static_cast<int64_t>(random.Uniform() * static_cast<double>(span));
    const int64_t to = from + 1 + random.Bits() % 30'000;
    const double expected =
        (antiderivative(to) - antiderivative(from)) / static_cast<double>(to - from);
    const auto average = Average(history, from, to);
    REQUIRE(average[0] == Approx(expected).margin(1e-9));
    REQUIRE(average[1] == Approx(-expected).margin(1e-9));
  }
}

}  // namespace
}  // namespace plumb
