#include "common/random.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace plumb {
namespace {

// Known answers of Philox4x32-10 from Random123's kat_vectors: counter and key all zero.
TEST_CASE("the generator is Philox4x32-10") {
  Random random(0);
  CHECK(random.Bits() == 0x6627e8d5);
  CHECK(random.Bits() == 0xe169c58d);
  CHECK(random.Bits() == 0xbc57ac4c);
  CHECK(random.Bits() == 0x9b00dbd8);
}

TEST_CASE("equal names give equal numbers, different ones different numbers") {
  Random a(5, {1, 2, 3}), b(5, {1, 2, 3}), c(5, {1, 2, 4}), d(6, {1, 2, 3});
  for (int i = 0; i < 10; ++i) {
    const uint32_t x = a.Bits();
    CHECK(x == b.Bits());
    CHECK(x != c.Bits());
    CHECK(x != d.Bits());
  }
  CHECK_THROWS(Random(1, {1, 2, 3, 4}));
}

TEST_CASE("moments of the uniform and the normal deviates") {
  Random random(1);
  double sum = 0, square = 0, normal = 0, normal2 = 0, normal4 = 0;
  constexpr int n = 200000;
  for (int i = 0; i < n; ++i) {
    const double u = random.Uniform(), z = random.Normal();
    REQUIRE(u >= 0);
    REQUIRE(u < 1);
    sum += u, square += u * u, normal += z, normal2 += z * z, normal4 += z * z * z * z;
  }
  CHECK(sum / n == Approx(0.5).margin(0.003));
  CHECK(square / n == Approx(1.0 / 3).margin(0.003));
  CHECK(normal / n == Approx(0).margin(0.01));
  CHECK(normal2 / n == Approx(1).margin(0.015));
  CHECK(normal4 / n == Approx(3).margin(0.15));
}

}  // namespace
}  // namespace plumb
