#include "estimator/sensor_watch.h"

#include <catch2/catch.hpp>

namespace plumb {
namespace {

using Finding = AgreementWatch::Finding;

constexpr double kElapsed = 1.0 / 64;  // sixteen make a window

TEST_CASE("a jump is told from what drifts besides, and a window's excess is of both") {
  AgreementWatch watch({.level_sd = 1e-4, .rate_sd = 1e-3});
  double level = 0;
  for (int i = 0; i <= 16; ++i) {
    level += 0.001 + (i == 8 ? 0.2 : 0.0);  // its rate says that it rests
    watch.Add(level, i % 2 * 1e-6, kElapsed);
  }
  CHECK(watch.finding() == Finding::kLevelJumped);
  CHECK(watch.jump() == Approx(0.201).margin(1e-6));
  CHECK(watch.excess() == Approx(0.216).margin(1e-6));
}

TEST_CASE("what goes there and back is no excess, and what drifts is no jump") {
  AgreementWatch watch({.level_sd = 1e-4, .rate_sd = 1e-3});
  const auto see = [&](auto level_at) {
    for (int i = 0; i <= 60; ++i) watch.Add(level_at(i), i % 2 * 1e-6, kElapsed);
    return watch.finding();
  };
  CHECK(see([](int i) { return i % 10 == 5 ? 0.2 : 1e-9 * i; }) == Finding::kNone);
  CHECK(see([](int i) { return 0.01 * i; }) == Finding::kDisagree);
}

}  // namespace
}  // namespace plumb
