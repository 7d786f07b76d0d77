#include "sim/virtual/encoder.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

namespace plumb {
namespace {

/// The constant acceleration a from rest.
ShaftMotion Accelerating(double a, int64_t begin, int64_t end) {
  const double s = static_cast<double>(begin) * 1e-6, t = static_cast<double>(end) * 1e-6;
  return {begin, end, a * s * s / 2, a * t * t / 2, a * s, a * t};
}

}  // namespace

TEST_CASE("a shaft's motion between instants is the cubic") {
  const auto position = [](double t) { return 1 - 2 * t + 30 * t * t - 400 * t * t * t; };
  const auto velocity = [](double t) { return -2 + 60 * t - 1200 * t * t; };
  const ShaftMotion motion{1'002'000,       1'007'000,       position(0.002),
                           position(0.007), velocity(0.002), velocity(0.007)};
  for (const int64_t us : {2000, 3125, 5000, 6999, 7000}) {
    CHECK(motion.Position(1'000'000 + us) ==
          Approx(position(static_cast<double>(us) * 1e-6)).epsilon(1e-13));
  }
  CHECK(ShaftMotion{5, 5, 3, 3, 1, 1}.Position(5) == 3);
}

TEST_CASE("positions are read to the nearest count") {
  const Encoder encoder(14);
  const double count = 1.0 / 16384;
  CHECK(encoder.Quantise(0) == 0);
  CHECK(encoder.Quantise(0.49 * count) == 0);
  CHECK(encoder.Quantise(0.51 * count) == count);
  CHECK(encoder.Quantise(-1000.51 * count) == -1001 * count);
  double square = 0, mean = 0;
  for (int i = 0; i < 10000; ++i) {
    const double turns = -3 + 6.1e-4 * i, error = encoder.Quantise(turns) - turns;
    square += error * error / 10000;
    mean += error / 10000;
  }
  // In radians at 14 bit: 1.1e-4, what robots/pendulum tells its estimator.
  CHECK(std::sqrt(square) == Approx(count / std::sqrt(12)).epsilon(0.02));
  CHECK(std::abs(mean) < count / 100);
}

TEST_CASE("the velocity follows with a lag of two over the bandwidth") {
  Encoder encoder(24);
  encoder.Reset(0, 0);
  const double a = 3;
  for (int64_t t = 0; t < 500'000; t += 3333) encoder.Track(Accelerating(a, t, t + 3333));
  const double end = 3333e-6 * 151;
  CHECK(encoder.velocity() == Approx(a * (end - 2 / Encoder::kBandwidth)).epsilon(1e-3));
}

TEST_CASE("the velocity's noise at 14 bit is what the class says") {
  Encoder encoder(14);
  const double v = 0.37;  // turns/s
  encoder.Reset(0, v);
  double square = 0;
  for (int64_t t = 0; t < 2'000'000; t += 5000) {
    encoder.Track({t, t + 5000, v * t * 1e-6, v * (t + 5000) * 1e-6, v, v});
    square += std::pow((encoder.velocity() - v) * 2 * M_PI, 2) / 400;
  }
  CHECK(std::sqrt(square) < 0.1);
  CHECK(std::sqrt(square) > 0.005);
}

TEST_CASE("the loop does not depend on how the motion is cut, and starts anew settled") {
  Encoder whole(14), cut(14);
  whole.Track(Accelerating(5, 0, 20'000));
  for (int64_t t = 0; t < 20'000; t += 400) cut.Track(Accelerating(5, t, t + 400));
  CHECK(cut.velocity() == Approx(whole.velocity()).epsilon(1e-9));
  CHECK(whole.velocity() > 0.05);

  whole.Reset(0.25, -1);
  CHECK(whole.velocity() == -1);
  whole.Track({0, 20'000, 0.25, 0.23, -1, -1});
  CHECK(whole.velocity() == Approx(-1).margin(0.02));
}

}  // namespace plumb
