#include "common/clock.h"

#include <atomic>
#include <catch2/catch.hpp>

namespace plumb {
namespace {

TEST_CASE("scaled time agrees with real time at the epoch and runs faster from there") {
  const int64_t epoch = 1'700'000'000'000'000;
  const Clock clock(4, epoch);
  CHECK(clock.UtimeFromRealtimeNs(epoch * 1000) == epoch);
  CHECK(clock.UtimeFromRealtimeNs((epoch + 1'000'000) * 1000) == epoch + 4'000'000);
  CHECK(clock.UtimeFromRealtimeNs((epoch - 1'000) * 1000) == epoch - 4'000);
  const timespec t = clock.RealDuration(10'000'000);
  CHECK(t.tv_sec == 2);
  CHECK(t.tv_nsec == 500'000'000);
  CHECK(clock.RealDuration(-5).tv_nsec == 0);
  CHECK(Clock(1).UtimeFromRealtimeNs(123'456'789) == 123'456);
}

TEST_CASE("a clock survives its own text") {
  const Clock clock(2.5, 1'700'000'000'000'001);
  CHECK(Clock::Parse(clock.ToString()).ToString() == clock.ToString());
  CHECK(Clock::Parse("3").scale() == 3);
  for (const char* text : {"", "x", "0", "-1", "1e9", "1@", "1@x", "1 ", "nan", "2@5z"}) {
    CHECK_THROWS_AS(Clock::Parse(text), std::invalid_argument);
  }
}

TEST_CASE("time goes on") {
  const Clock clock;
  const int64_t now = clock.Now(), utime = clock.Utime();
  CHECK(clock.Now() >= now);
  CHECK(clock.Utime() >= utime);
}

TEST_CASE("absolute deadlines do not drift, missed ones are skipped") {
  Periodic periodic(100, 1000);
  CHECK(periodic.Remaining(1000) == 100);
  CHECK_FALSE(periodic.Due(1099));
  CHECK(periodic.Due(1100));
  CHECK(periodic.Advance(1130) == 30);  // late, but the next deadline stays at 1200
  CHECK(periodic.Remaining(1130) == 70);
  CHECK(periodic.Advance(1520) == 320);  // 1300, 1400, 1500 were missed
  CHECK(periodic.Remaining(1520) == 80);
}

TEST_CASE("virtual time is what it is told to be, everywhere the same") {
  const auto time = std::make_shared<VirtualTime>();
  time->now = 1'000'000;
  const Clock clock(time);
  CHECK(clock.is_virtual());
  CHECK_FALSE(Clock().is_virtual());
  for (int i = 0; i < 2; ++i, time->now += 250) {
    CHECK(clock.Utime() == time->now);
    CHECK(clock.Now() == time->now);
    CHECK(clock.SigningUtime() == time->now);
  }
  CHECK(clock.UtimeFromRealtimeNs(1'000'250'000) == 1'000'250);  // of a frame's stamp
  // Somebody sets the clock: dates are other ones, intervals are not.
  time->error = -30;
  CHECK(clock.Utime() == time->now - 30);
  CHECK(clock.SigningUtime() == time->now - 30);
  CHECK(clock.UtimeFromRealtimeNs(1'000'250'000) == 1'000'220);
  CHECK(clock.Now() == time->now);
}

}  // namespace
}  // namespace plumb
