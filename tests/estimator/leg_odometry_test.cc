#include "estimator/leg_odometry.h"
#include "common/decompositions.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/estimator/walker.h"

namespace plumb {
namespace {

using namespace walker;

TEST_CASE("feet and IMU tell height, tilt and velocity of a body in space, and how well") {
  const double sway = GENERATE(0.0, 1.0);
  const int num_feet = GENERATE(2, 4);
  LegOdometry::Settings settings = Settings();
  settings.give = GENERATE(0.0, 1e-3);  // 1 cm under a single foot
  INFO("sway " << sway << ", " << num_feet << " feet, give " << settings.give);
  double nees = 0, height = 0, tilt = 0, velocity = 0;
  int count = 0;
  for (uint64_t seed = 1; seed <= 25; ++seed) {
    Walker walker(seed, num_feet, settings);
    walker.sway = sway;
    walker.Start();
    walker.Run(2);
    for (int i = 0; i < 4; ++i) {
      walker.Run(0.5);
      for (size_t foot = 0; foot < walker.places.size(); ++foot) REQUIRE(walker.filter.rests(foot));
      const auto e = walker.Error();
      nees += e.dot(walker.filter.covariance().ldlt().solve(e)) / 9;
      height += e[2] * e[2];
      velocity += e.segment<3>(3).squaredNorm() / 3;
      tilt += e.segment<2>(6).squaredNorm() / 2;
      ++count;
    }
    CHECK(walker.filter.slips() <= 10);  // of 3200 corrections at 99.9 %
  }
  INFO("rms height " << std::sqrt(height / count) << " m, tilt " << std::sqrt(tilt / count)
                     << " rad, velocity " << std::sqrt(velocity / count) << " m/s; NEES "
                     << nees / count);
  CHECK(nees / count > 0.75);
  CHECK(nees / count < 1.5);
  CHECK(std::sqrt(height / count) < 3e-3);
  CHECK(std::sqrt(tilt / count) < 0.01);
  CHECK(std::sqrt(velocity / count) < 0.03);
}

TEST_CASE("heading and horizontal position are not known, and the less the longer") {
  Walker walker(3, 3);
  walker.Start();
  walker.Run(2);
  const LegOdometry& f = walker.filter;
  const double heading = f.angle_sd(Vector3d::UnitZ()), x = f.position_sd(Vector3d::UnitX()),
               y = f.position_sd(Vector3d::UnitY()), z = f.position_sd(Vector3d::UnitZ()),
               roll = f.angle_sd(Vector3d::UnitX()), pitch = f.angle_sd(Vector3d::UnitY());
  walker.Run(20);
  CHECK(f.angle_sd(Vector3d::UnitZ()) > heading);
  CHECK(f.position_sd(Vector3d::UnitX()) > 1.5 * x);
  CHECK(f.position_sd(Vector3d::UnitY()) > 1.5 * y);
  CHECK(f.position_sd(Vector3d::UnitZ()) < 1.2 * z);
  CHECK(f.angle_sd(Vector3d::UnitX()) < 1.2 * roll);
  CHECK(f.angle_sd(Vector3d::UnitY()) < 1.2 * pitch);
}

TEST_CASE("a tilt guessed wrong, and biases, are found") {
  LegOdometry::Settings s = Settings();
  s.angle_sd = 0.2;
  Walker walker(5, 3, s);
  walker.Start(Quaterniond(Eigen::AngleAxisd(0.2, Vector3d::UnitY())));
  CHECK(walker.Error().segment<2>(6).norm() > 0.1);
  walker.Run(5);
  CHECK(walker.Error().segment<2>(6).norm() < 0.02);
  walker.Run(25);
  CHECK((walker.filter.rate_bias() - walker.rate_bias).head<2>().norm() < 3e-3);
  CHECK(std::abs((walker.filter.acceleration_bias() - walker.acceleration_bias).z()) < 0.02);
}

TEST_CASE("a foot that slips or is lifted is noticed, and breaks nothing") {
  Walker walker(7, 3);
  walker.Start();
  walker.Run(2);
  const int64_t slips = walker.filter.slips();
  SECTION("slips") {
    for (int i = 0; i < 20; ++i) {
      walker.places[0].x() += 0.01;
      walker.Step();
    }
    CHECK(walker.filter.slips() > slips);
  }
  SECTION("is lifted and set down elsewhere") {
    walker.places[0].z() += 0.1;
    walker.Step();
    CHECK_FALSE(walker.filter.rests(0));
    CHECK(walker.filter.rests(1));
    for (int i = 0; i < 40; ++i) walker.places[0].z() = 0.1, walker.Step();
    walker.places[0] += Vector3d(0.1, 0.1, 0);
  }
  walker.Run(1);
  for (size_t i = 0; i < 3; ++i) CHECK(walker.filter.rests(i));
  const auto e = walker.Error();
  CHECK(std::abs(e[2]) < 0.01);
  CHECK(e.segment<3>(3).norm() < 0.1);
  CHECK(e.segment<2>(6).norm() < 0.02);
  CHECK_FALSE(walker.filter.astray());
}

TEST_CASE("who flies grows unsure, and who is held up without feet is astray") {
  Walker walker(9, 2);
  walker.Start();
  walker.Run(1);
  for (Vector3d& place : walker.places) place.z() += 1;  // pulled up
  const double z = walker.filter.position_sd(Vector3d::UnitZ());
  for (int i = 0; i < 60; ++i) {
    for (Vector3d& place : walker.places) place.z() = 1;
    walker.Step();
  }
  CHECK(walker.filter.position_sd(Vector3d::UnitZ()) > 1.5 * z);
  CHECK_FALSE(walker.filter.astray());
  for (int i = 0; i < 60; ++i) {
    for (Vector3d& place : walker.places) place.z() = 1;
    walker.Step();
  }
  CHECK(walker.filter.astray());
}

TEST_CASE("legs that swing in flight do not hold the body up") {
  Walker walker(9, 2);
  walker.sway = 0;
  walker.Start();
  walker.Run(1);
  for (Vector3d& place : walker.places) place.z() += 3;
  for (int i = 0; i < 120; ++i) {
    walker.filter.Predict(kPeriod, Vector3d::Zero(), 0.6 * kGravity * Vector3d::UnitZ());
    walker.filter.Correct(walker.Feet());
  }
  CHECK_FALSE(walker.filter.astray());
}

TEST_CASE("on ground that gives way a lot a foot in the air does not rest all the same") {
  LegOdometry::Settings s = Settings();
  s.normal = Vector3d::UnitY();
  s.ground_sd = 0.03;
  Walker walker(12, 2, s);
  walker.sway = 0;
  walker.filter.Restart(LegOdometry::Beginning::kStands, Vector3d::Zero(), Quaterniond::Identity(),
                        walker.Feet());
  walker.Run(1);
  REQUIRE(walker.filter.rests(0));
  for (int i = 0; i < 40; ++i) {
    walker.places[0].z() = 0.3;
    walker.Step();
  }
  CHECK_FALSE(walker.filter.rests(0));
  CHECK(walker.filter.rests(1));
  CHECK_FALSE(walker.filter.astray());
}

// One leg as stiff as a rod, on ground that gives way by a centimetre under it.
TEST_CASE("who lands hard keeps its height on ground that gives way") {
  LegOdometry::Settings s = Settings();
  s.normal = Vector3d::UnitY();
  s.give = 1e-3, s.settles_in = 1.0 / 30, s.ground_sd = 0.018;
  const double speed = GENERATE(1.0, 1.5, 2.0), leg = 0.5;
  LegOdometry filter(s, 1);
  std::vector<LegOdometry::Foot> feet(1);
  feet[0].radius = kRadius;
  feet[0].centre = (kRadius - leg) * Vector3d::UnitZ();
  double z = leg - s.give * kGravity, v = 0;
  filter.Restart(LegOdometry::Beginning::kStands, Vector3d::Zero(), Quaterniond::Identity(), feet);
  double worst = 0, deepest = 0, landed = -1;
  for (int i = 0; i < 400; ++i) {
    double felt = 0;
    for (int k = 0; k < 50; ++k) {
      const double dt = kPeriod / 50, in = leg - z;
      double force = in > 0 ? std::max(0.0, (in - s.settles_in * v) / s.give) : 0;
      if (i == 200) force = kGravity + speed / kPeriod;  // jumps
      v += dt * (force - kGravity), z += dt * v;
      felt += force / 50;
    }
    filter.Predict(kPeriod, Vector3d::Zero(), felt * Vector3d::UnitZ());
    filter.Correct(feet);
    if (i > 210 && landed < 0 && z < leg) landed = i;
    if (i > 210) deepest = std::max(deepest, leg - z);
    if (landed > 0 && i > landed + 6) worst = std::max(worst, std::abs(filter.position().z() - z));
  }
  INFO("landed at " << speed << " m/s, pressed the ground in by " << deepest << " m, height off by "
                    << worst << " m");
  CHECK(landed > 0);
  CHECK(deepest > 0.02);
  CHECK(worst < 0.012);
  CHECK_FALSE(filter.astray());
}

TEST_CASE("a foot that grazes the ground in swinging by does not rest on it") {
  Walker walker(5, 3);
  walker.sway = 0;
  walker.Start();
  walker.Run(1);
  for (int i = 0; i < 20; ++i) walker.places[0].z() = 0.2, walker.Step();
  REQUIRE_FALSE(walker.filter.rests(0));
  walker.places[0].z() = kRadius;
  for (const double speed : {3.0, 0.0}) {
    for (int i = 0; i < 8; ++i) {
      walker.places[0].x() += speed * kPeriod;
      walker.filter.Predict(kPeriod, walker.rate_bias,
                            kGravity * Vector3d::UnitZ() + walker.acceleration_bias);
      auto feet = walker.Feet();
      feet[0].velocity.x() += speed;
      walker.filter.Correct(feet);
    }
    CHECK(walker.filter.rests(0) == (speed == 0));
  }
}

TEST_CASE("a force that is beyond what can be read is not well known") {
  Walker walker(9, 2);
  walker.sway = 0;  // level
  walker.Start();
  walker.Run(1);
  LegOdometry filter = walker.filter, exact = filter;
  const Vector3d up = Vector3d::UnitZ(), across = Vector3d::UnitX(), read = 100 * up;
  for (int i = 0; i < 3; ++i) {
    filter.Predict(kPeriod, Vector3d::Zero(), read, {.rate = false, .force = true});
    exact.Predict(kPeriod, Vector3d::Zero(), read);
  }
  CHECK((filter.velocity() - exact.velocity()).norm() < 1e-9);
  const double unread = std::sqrt(3) * 0.1 * 100 * kPeriod;
  CHECK(filter.velocity_sd(up) == Approx(std::hypot(exact.velocity_sd(up), unread)).epsilon(1e-3));
  CHECK(filter.velocity_sd(across) == Approx(exact.velocity_sd(across)).epsilon(0.02));
}

TEST_CASE("nor is a rate, and the force that was felt with it is as good as ever") {
  Walker walker(9, 2);
  walker.sway = 0;
  walker.Start();
  walker.Run(1);
  LegOdometry filter = walker.filter, exact = filter;
  const Vector3d x = Vector3d::UnitX(), y = Vector3d::UnitY(), read = 35 * x,
                 force = kGravity * Vector3d::UnitZ();
  filter.Predict(kPeriod, read, force, {.rate = true, .force = false});
  exact.Predict(kPeriod, read, force);
  const double unturned = 0.1 * 35 * kPeriod;
  CHECK(filter.angle_sd(x) == Approx(std::hypot(exact.angle_sd(x), unturned)).epsilon(1e-3));
  CHECK(filter.angle_sd(y) == Approx(exact.angle_sd(y)).epsilon(0.02));
  CHECK(filter.velocity_sd(x) == Approx(exact.velocity_sd(x)));
}

TEST_CASE("in a plane nothing leaves it") {
  LegOdometry::Settings s = Settings();
  s.normal = Vector3d::UnitY();
  Walker walker(11, 2, s);
  walker.sway = 0;
  walker.filter.Restart(LegOdometry::Beginning::kStands, Vector3d::Zero(), Quaterniond::Identity(),
                        walker.Feet());
  walker.Run(2);
  constexpr double kRounding = 1e-6;
  CHECK(std::abs(walker.filter.position().y()) < kRounding);
  CHECK(std::abs(walker.filter.velocity().y()) < kRounding);
  CHECK(std::abs(walker.filter.orientation().x()) < kRounding);
  CHECK(std::abs(walker.filter.orientation().z()) < kRounding);
  CHECK(walker.filter.position_sd(Vector3d::UnitY()) < kRounding);
  CHECK(walker.filter.angle_sd(Vector3d::UnitX()) < kRounding);
  CHECK(walker.filter.angle_sd(Vector3d::UnitY()) > 0);
  CHECK(std::abs(walker.filter.position().z() - 0.5) < 0.01);
}

}  // namespace
}  // namespace plumb
