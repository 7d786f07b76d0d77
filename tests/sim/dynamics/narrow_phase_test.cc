// Where solids are near each other, beside alternating projections: the nearest points of two
// convex sets are what projecting on the one and the other in turn ends at (Cheney and Goldstein,
// 1959).
#include "sim/dynamics/narrow_phase.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "common/random.h"
#include "tests/sim/trees.h"

namespace plumb {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kMargin = 0.5;

Vector<double> Write(const Vector3d& v) { return {v.x(), v.y(), v.z()}; }
Vector3d Read(const Vector<double>& v) { return {v.x, v.y, v.z}; }

Matrix3d DrawAxes(Random& random) {
  return Eigen::AngleAxisd(random.Uniform(0, 3), DrawDirection(random)).toRotationMatrix();
}

PlacedSolid Solid(const Vector3d& centre, const Matrix3d& axes, const Vector3d& half,
                  double radius) {
  return {Write(centre),
          {Write(axes.col(0)), Write(axes.col(1)), Write(axes.col(2))},
          {half.x(), half.y(), half.z()},
          radius};
}

// A sphere, a capsule or a box.
PlacedSolid Draw(int kind, Random& random) {
  const Vector3d centre = DrawVector(random, 0.3);
  const Matrix3d axes = DrawAxes(random);
  const auto size = [&] { return random.Uniform(0.02, 0.15); };
  if (kind == 0) return Solid(centre, axes, Vector3d::Zero(), size());
  if (kind == 1) return Solid(centre, axes, {0, 0, size()}, size() / 3);
  return Solid(centre, axes, {size(), size(), size()}, 0);
}

Vector3d Project(const PlacedSolid& core, const Vector3d& point) {
  Vector3d nearest = Read(core.centre);
  for (size_t k = 0; k < 3; ++k) {
    const Vector3d axis = Read(core.axes[k]);
    nearest += std::clamp(axis.dot(point - Read(core.centre)), -core.half[k], core.half[k]) * axis;
  }
  return nearest;
}

double CoresApart(const PlacedSolid& first, const PlacedSolid& second) {
  Vector3d on_second = Read(second.centre), on_first;
  for (int i = 0; i < 20'000; ++i) {
    on_first = Project(first, on_second);
    const Vector3d next = Project(second, on_first);
    const bool stands = (next - on_second).norm() < 1e-13;
    on_second = next;
    if (stands) break;
  }
  return (on_second - on_first).norm();
}

double Apart(const PlacedSolid& first, const PlacedSolid& second) {
  return CoresApart(first, second) - first.radius - second.radius;
}

const NearSpot& Nearest(const NearSpots& spots, int count) {
  return *std::min_element(
      spots.begin(), spots.begin() + count,
      [](const NearSpot& a, const NearSpot& b) { return a.distance < b.distance; });
}

// How far a point is outside a solid; negative in a radius.
double Outside(const PlacedSolid& solid, const Vector3d& point) {
  return (Project(solid, point) - point).norm() - solid.radius;
}

}  // namespace

TEST_CASE("narrow phase: solids whose cores are apart") {
  Random random(5);
  int near = 0, overlap = 0;
  for (int i = 0; i < 3000; ++i) {
    const PlacedSolid first = Draw(i % 3, random), second = Draw(i / 3 % 3, random);
    if (first.is_box() && second.is_box()) continue;
    const double cores = CoresApart(first, second), apart = Apart(first, second);
    if (cores < 1e-3) continue;
    NearSpots spots;
    const int count = FindNearSpots(first, second, kMargin, &spots);
    INFO(i << ": " << apart << " m apart");
    if (apart > kMargin) {
      CHECK(count == 0);
      continue;
    }
    REQUIRE(count >= 1);
    REQUIRE(count <= static_cast<int>(MostSpots(first.half.data(), second.half.data())));
    const NearSpot& nearest = Nearest(spots, count);
    CHECK(nearest.distance ==
          Approx(apart).margin(2e-5));  // projections are slow at grazing angles
    CHECK(Read(nearest.normal).norm() == Approx(1));
    // The surfaces' points are on the surfaces, and the normal points from one to the other.
    const Vector3d half = nearest.distance / 2 * Read(nearest.normal),
                   on_first = Read(nearest.position) - half,
                   on_second = Read(nearest.position) + half;
    CHECK(std::abs(Outside(first, on_first)) < 1e-6);
    CHECK(std::abs(Outside(second, on_second)) < 1e-6);
    ++near, overlap += apart < 0;
  }
  CHECK(near > 1500);
  CHECK(overlap > 100);
}

TEST_CASE("narrow phase: boxes") {
  Random random(6);
  int apart_count = 0, overlap = 0, edges = 0;
  for (int i = 0; i < 3000; ++i) {
    const PlacedSolid first = Draw(2, random);
    PlacedSolid second = Draw(2, random);
    const double apart = Apart(first, second);
    NearSpots spots;
    const int count = FindNearSpots(first, second, kMargin, &spots);
    INFO(i << ": " << apart << " m apart, " << count << " spots");
    if (apart > 1e-4) {
      ++apart_count;
      for (int k = 0; k < count; ++k) {
        const NearSpot& spot = spots[static_cast<size_t>(k)];
        CHECK(spot.distance > -1e-9);
        CHECK(Outside(first, Read(spot.position)) < kMargin);
        CHECK(Outside(second, Read(spot.position)) < kMargin);
      }
      continue;
    }
    if (apart > 1e-9) continue;  // the projections have not ended
    ++overlap, edges += count == 1;
    REQUIRE(count >= 1);
    const NearSpot nearest = Nearest(spots, count);
    REQUIRE(nearest.distance < 0);
    // Moved apart by the depth they touch no longer; by less they still do.
    const auto moved = [&](double share) {
      PlacedSolid there = second;
      there.centre = Write(Read(second.centre) - share * nearest.distance * Read(nearest.normal));
      return Apart(first, there);
    };
    CHECK(moved(1.02) > 0);
    // projections on what overlaps just so end late
    if (nearest.distance < -0.02) CHECK(moved(0.98) < 5e-4);
    for (int k = 0; k < count; ++k) {
      const NearSpot& spot = spots[static_cast<size_t>(k)];
      const double reach = std::abs(spot.distance) / 2 + 1e-6;
      if (spot.distance < 0) {
        CHECK(Outside(first, Read(spot.position)) < reach);
        CHECK(Outside(second, Read(spot.position)) < reach);
      }
    }
  }
  CHECK(apart_count > 500);
  CHECK(overlap > 300);
  CHECK(edges > 20);
}

TEST_CASE("narrow phase: what lies flat is held at its ends and corners") {
  const Matrix3d straight = Matrix3d::Identity();
  Matrix3d lying;  // its third axis along x
  lying << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  const PlacedSolid table = Solid({0, 0, -0.1}, straight, {0.5, 0.3, 0.1}, 0);
  const auto spots_of = [&](const PlacedSolid& solid, const PlacedSolid& on) {
    NearSpots spots;
    std::vector<Vector3d> at;
    const int count = FindNearSpots(on, solid, 0.01, &spots);
    for (int i = 0; i < count; ++i) {
      const NearSpot& spot = spots[static_cast<size_t>(i)];
      CHECK((Read(spot.normal) - Vector3d::UnitZ()).norm() < 1e-9);
      CHECK(spot.distance == Approx(-0.001));
      at.push_back(Read(spot.position));
    }
    std::sort(at.begin(), at.end(), [](const Vector3d& a, const Vector3d& b) {
      return std::pair(a.x(), a.y()) < std::pair(b.x(), b.y());
    });
    return at;
  };
  const auto held = [&](const PlacedSolid& rod, const PlacedSolid& on, double begin, double end) {
    const auto at = spots_of(rod, on);
    REQUIRE(at.size() == 2);
    CHECK(at[0].x() == Approx(begin));
    CHECK(at[1].x() == Approx(end));
  };
  SECTION("a rod on a table") {
    held(Solid({0.1, 0, 0.049}, lying, {0, 0, 0.2}, 0.05), table, -0.1, 0.3);
  }
  SECTION("a rod across a narrow table is held by its edges") {
    held(Solid({0.1, 0, 0.049}, lying, {0, 0, 2}, 0.05), table, -0.5, 0.5);
  }
  SECTION("a rod on a rod") {
    const PlacedSolid rod = Solid(Vector3d::Zero(), lying, {0, 0, 0.2}, 0.05);
    held(Solid({0.1, 0, 0.099}, lying, {0, 0, 0.2}, 0.05), rod, -0.1, 0.2);
  }
  SECTION("a box on a table") {
    const auto at = spots_of(Solid({0, 0, 0.049}, straight, {0.1, 0.2, 0.05}, 0), table);
    REQUIRE(at.size() == 4);
    CHECK((at[0] - Vector3d(-0.1, -0.2, -0.0005)).norm() < 1e-9);
    CHECK((at[3] - Vector3d(0.1, 0.2, -0.0005)).norm() < 1e-9);
  }
  SECTION("a plank across a plank, none of whose corners is in the other") {
    const auto at = spots_of(Solid({0, 0, 0.049}, straight, {0.1, 2, 0.05}, 0), table);
    REQUIRE(at.size() == 4);
    CHECK((at[0] - Vector3d(-0.1, -0.3, -0.0005)).norm() < 1e-5);
    CHECK((at[3] - Vector3d(0.1, 0.3, -0.0005)).norm() < 1e-5);
  }
  SECTION("a box flush on one of its size, but for rounding") {
    Random random(8);
    const PlacedSolid below = Solid({0, 0, -0.1}, straight, {0.1, 0.1, 0.1}, 0);
    for (int i = 0; i < 1000; ++i) {
      const auto tiny = [&] { return random.Uniform(-2e-9, 2e-9); };
      const Matrix3d turned = Eigen::AngleAxisd(tiny(), Vector3d::UnitZ()).toRotationMatrix();
      NearSpots spots;
      const int count = FindNearSpots(
          below, Solid({tiny(), tiny(), 0.099}, turned, {0.1, 0.1, 0.1}, 0), 0.01, &spots);
      REQUIRE(count == 4);
      for (int k = 0; k < count; ++k) {
        const Vector3d at = Read(spots[static_cast<size_t>(k)].position);
        REQUIRE((at.cwiseAbs() - Vector3d(0.1, 0.1, 0.0005)).norm() < 1e-5);
      }
    }
  }
  SECTION("a box turned by an eighth on one of its size: eight corners") {
    const Matrix3d turned = Eigen::AngleAxisd(M_PI / 4, Vector3d::UnitZ()).toRotationMatrix();
    const PlacedSolid below = Solid({0, 0, -0.1}, straight, {0.1, 0.1, 0.1}, 0);
    CHECK(spots_of(Solid({0, 0, 0.099}, turned, {0.1, 0.1, 0.1}, 0), below).size() == 8);
  }
}

TEST_CASE("narrow phase: what is nowhere is near nothing") {
  Random random(7);
  NearSpots spots;
  for (int kind = 0; kind < 9; ++kind) {
    PlacedSolid first = Draw(kind % 3, random), second = Draw(kind / 3, random);
    second.centre = first.centre;  // concentric ones have some normal
    const int count = FindNearSpots(first, second, 0.01, &spots);
    for (int i = 0; i < count; ++i) {
      CHECK(Read(spots[static_cast<size_t>(i)].normal).norm() == Approx(1));
      CHECK(Read(spots[static_cast<size_t>(i)].position).allFinite());
    }
    CHECK(count >= 1);
    first.centre.x = std::nan("");
    CHECK(FindNearSpots(first, second, 0.01, &spots) == 0);
    first.centre.x = HUGE_VAL;
    CHECK(FindNearSpots(first, second, 0.01, &spots) == 0);
  }
}

}  // namespace plumb
