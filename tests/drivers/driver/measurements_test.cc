#include "drivers/driver/measurements.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "common/random.h"

namespace plumb {
namespace {

constexpr int64_t kPeriod = 5000;
constexpr int64_t kStart = 1'700'000'000'000'000;

/// Joint j's k-th estimate has position k + j/10.
JointMeasurement At(int k, int joint) { return {k + joint / 10.0, 0, 0}; }

TEST_CASE("a measurement is complete with every joint's estimate, and comes once") {
  Measurements measurements(2, kPeriod);
  std::vector<JointMeasurement> set(2);
  int64_t utime;
  measurements.Add(0, At(0, 0), kStart);
  CHECK_FALSE(measurements.Next(utime, set));
  measurements.Add(1, At(0, 1), kStart + 40);
  REQUIRE(measurements.Next(utime, set));
  CHECK(utime == kStart + 40);
  CHECK(set[0].position == 0);
  CHECK(set[1].position == 0.1);
  CHECK_FALSE(measurements.Next(utime, set));
}

TEST_CASE("a clock that is set back between two joints' estimates does not part them for ever") {
  Measurements measurements(2, kPeriod);
  std::vector<JointMeasurement> set(2);
  int64_t utime;
  int complete = 0;
  for (int k = 0; k < 60; ++k) {
    const int64_t sent = kStart + 5000 * k;
    measurements.Add(0, At(k, 0), sent - (k < 20 ? 0 : 500'000));
    measurements.Add(1, At(k, 1), sent + 40 - (k < 21 ? 0 : 500'000));
    while (measurements.Next(utime, set)) {
      ++complete;
      CHECK(set[1].position == Approx(set[0].position + 0.1));
    }
  }
  CHECK(complete >= 55);
  CHECK(measurements.lost() >= 2);
}

TEST_CASE("several measurements that arrive together come one after the other") {
  Measurements measurements(1, kPeriod);
  std::vector<JointMeasurement> set(1);
  for (int k = 0; k < 4; ++k) measurements.Add(0, At(k, 0), kStart + 5000 * k);
  int64_t utime;
  for (int k = 0; k < 4; ++k) {
    REQUIRE(measurements.Next(utime, set));
    CHECK(set[0].position == k);
    CHECK(utime == Approx(kStart + 5000 * k).margin(5));
  }
  CHECK_FALSE(measurements.Next(utime, set));
}

TEST_CASE("lost estimates never pair what was measured more than 0.6 periods apart") {
  Random random(2, {4});
  for (const int64_t phase : {0, 1500, 2400, 3800}) {
    Measurements measurements(2, kPeriod);
    std::vector<JointMeasurement> set(2);
    int64_t last = 0;
    int complete = 0;
    const auto take_all = [&] {
      int64_t utime;
      while (measurements.Next(utime, set)) {
        REQUIRE(utime > last);
        last = utime;
        const double measured0 = set[0].position * kPeriod;
        const double measured1 = (set[1].position - 0.1) * kPeriod + static_cast<double>(phase);
        REQUIRE(std::abs(measured0 - measured1) < 0.6 * kPeriod + 100);
        REQUIRE(static_cast<double>(utime - kStart) ==
                Approx(std::max(measured0, measured1)).margin(210));
        ++complete;
      }
    };
    for (int k = 0; k < 5000; ++k) {
      if (random.Uniform() >= 0.05)
        measurements.Add(0, At(k, 0), kStart + kPeriod * k + random.Bits() % 200);
      take_all();
      if (random.Uniform() >= 0.05)
        measurements.Add(1, At(k, 1), kStart + kPeriod * k + phase + random.Bits() % 200);
      take_all();
    }
    INFO("phase " << phase);
    CHECK(complete > 5000 * 0.88);  // 0.95 squared is 0.90
  }
}

TEST_CASE("a silent joint stops the measurements, not the others' time") {
  Measurements measurements(2, kPeriod);
  std::vector<JointMeasurement> set(2);
  int64_t utime;
  for (int k = 0; k < 1000; ++k) {
    measurements.Add(0, At(k, 0), kStart + kPeriod * k);
    CHECK_FALSE(measurements.Next(utime, set));
  }
  measurements.Add(1, At(999, 1), kStart + kPeriod * 999 + 30);
  REQUIRE(measurements.Next(utime, set));
  CHECK(set[0].position == 999);
  CHECK(utime == Approx(kStart + kPeriod * 999 + 30).margin(600));
  CHECK(measurements.lost() == 999);
}

}  // namespace
}  // namespace plumb
