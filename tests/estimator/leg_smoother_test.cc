#include "estimator/leg_smoother.h"
#include "common/decompositions.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <deque>
#include <limits>

#include "tests/estimator/walker.h"

namespace plumb {
namespace {

using namespace walker;

constexpr int64_t kStep = 5000;  // [us], kPeriod
constexpr int kLag = 20;

using Error = Eigen::Matrix<double, 9, 1>;

/// A walker whose motion of kLag readings ago is told, too.
struct Smoothed {
  explicit Smoothed(uint64_t seed, int num_feet)
      : body(seed, num_feet), smoother(static_cast<size_t>(num_feet), kLag + 2) {
    body.Start();
    body.filter.Tell(smoother);
    smoother.Keep(1, body.filter);
  }
  void Step() {
    errors.push_front(body.Error());
    body.Step();
    utime += kStep;
    smoother.Keep(utime, body.filter);
    if (errors.size() > kLag) errors.resize(kLag);
  }
  /// Its error then.
  Error ErrorAt(const LegSmoother::Motion& motion) const {
    const double then = 1e-6 * static_cast<double>(motion.utime - 1);
    Error e;
    const Eigen::AngleAxisd turn(body.Orientation(then) * motion.orientation.conjugate());
    e << body.Position(then) - motion.position, body.Velocity(then) - motion.velocity,
        turn.angle() * turn.axis();
    return e;
  }

  Walker body;
  LegSmoother smoother;
  int64_t utime = 1;
  std::deque<Error> errors;  // of the filter, the newest first
};

double SmootherNees(const Error& e, const Eigen::Matrix<double, 9, 9>& covariance) {
  return e.dot(covariance.ldlt().solve(e)) / 9;
}

TEST_CASE("what came later tells of a body's motion, and how well it is known then") {
  const int num_feet = GENERATE(2, 4);
  double nees = 0, causal_velocity = 0, velocity = 0, causal_lean = 0, lean = 0, between = 0;
  int count = 0;
  for (uint64_t seed = 1; seed <= 25; ++seed) {
    Smoothed s(seed, num_feet);
    for (int i = 0; i < 400; ++i) s.Step();
    for (int i = 0; i < 4; ++i) {
      for (int k = 0; k < 50; ++k) s.Step();
      const LegSmoother::Motion* motion = s.smoother.At(s.utime - kLag * kStep);
      REQUIRE(motion);
      const Error e = s.ErrorAt(*motion), before = s.errors.back();
      nees += SmootherNees(e, motion->covariance.topLeftCorner<9, 9>());
      velocity += e.segment<3>(3).squaredNorm(), lean += e.segment<2>(6).squaredNorm();
      causal_velocity += before.segment<3>(3).squaredNorm();
      causal_lean += before.segment<2>(6).squaredNorm();
      between +=
          s.ErrorAt(*s.smoother.At(s.utime - kLag * kStep + kStep / 3)).segment<3>(3).squaredNorm();
      ++count;
    }
  }
  INFO(num_feet << " feet: NEES " << nees / count << "; velocity " << std::sqrt(velocity / count)
                << " (in between " << std::sqrt(between / count) << ") for "
                << std::sqrt(causal_velocity / count) << ", lean " << std::sqrt(lean / count)
                << " for " << std::sqrt(causal_lean / count));
  CHECK(nees / count > 0.75);
  CHECK(nees / count < 1.5);
  CHECK(velocity < 0.8 * causal_velocity);
  CHECK(between < 0.8 * causal_velocity);
  CHECK(lean < 1.05 * causal_lean);
}

TEST_CASE("the newest is as the filter has it, the information never grows less with a reading") {
  Smoothed s(3, 3);
  for (int i = 0; i < 100; ++i) s.Step();
  const LegSmoother::Motion* newest = s.smoother.At(s.utime);
  REQUIRE(newest);
  CHECK((newest->position - s.body.filter.position()).norm() < 1e-15);
  CHECK((newest->covariance.topLeftCorner<9, 9>() - s.body.filter.covariance()).norm() < 1e-15);
  double last = std::numeric_limits<double>::infinity();
  const int64_t then = s.utime;
  for (int i = 0; i < kLag; ++i) {
    const LegSmoother::Motion* motion = s.smoother.At(then);
    REQUIRE(motion);
    const Eigen::Matrix<double, 9, 9> covariance = motion->covariance.topLeftCorner<9, 9>();
    CHECK(covariance.trace() <= last * (1 + 1e-9));
    CHECK((covariance - covariance.transpose()).norm() < 1e-9 * covariance.norm());
    CHECK(covariance.diagonal().minCoeff() > 0);
    last = covariance.trace();
    s.Step();
  }
  CHECK_FALSE(s.smoother.At(then - 10 * kStep));  // forgotten
  CHECK_FALSE(s.smoother.At(s.utime + 1));
  s.smoother.Restart();
  CHECK_FALSE(s.smoother.At(s.utime));
}

TEST_CASE("through a foot's being lifted and set down elsewhere it stays honest") {
  double nees = 0;
  int count = 0;
  for (uint64_t seed = 1; seed <= 25; ++seed) {
    Smoothed s(seed, 4);
    for (int i = 0; i < 200; ++i) s.Step();
    for (int stride = 0; stride < 4; ++stride) {
      const auto foot = static_cast<size_t>(stride);
      const Vector3d place = s.body.places[foot];
      for (int i = 0; i < 15; ++i) {
        s.body.places[foot] = place + Vector3d(0.005 * i, 0, 0.05);
        s.Step();
      }
      s.body.places[foot] = place + Vector3d(0.08, 0, 0);
      for (int i = 0; i < 8; ++i) s.Step();
      const LegSmoother::Motion* motion = s.smoother.At(s.utime - kLag * kStep);
      REQUIRE(motion);
      nees += SmootherNees(s.ErrorAt(*motion), motion->covariance.topLeftCorner<9, 9>());
      ++count;
    }
  }
  INFO("NEES " << nees / count);
  CHECK(nees / count > 0.7);
  CHECK(nees / count < 2);
}

}  // namespace
}  // namespace plumb
