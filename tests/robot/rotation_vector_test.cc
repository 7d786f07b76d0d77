#include "robot/rotation_vector.h"

#include <catch2/catch.hpp>
#include <numbers>

namespace plumb {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

TEST_CASE("a rotation vector turns about itself, by its length") {
  const double angle = GENERATE(0.0, 1e-150, 1e-12, 0.9e-9, 1.1e-9, 1e-3, 1.0, 3.0, 7.0);
  const Vector3d axis = Vector3d(2, -3, 6) / 7;
  const Quaterniond turn = FromRotationVector(angle * axis);
  CHECK(turn.norm() == Approx(1).epsilon(1e-15));
  CHECK(turn.w() == Approx(std::cos(angle / 2)).epsilon(0).margin(1e-15));
  const Vector3d expected = std::sin(angle / 2) * axis;
  CHECK((turn.vec() - expected).norm() <= 1e-15 * expected.norm());
}

TEST_CASE("the vector of a rotation is the shortest, of either of its quaternions") {
  const double angle = GENERATE(1e-150, 1e-12, 1e-3, 1.0, 3.0, std::numbers::pi);
  const double length = GENERATE(0.5, 1.0, -1.0, -3.0);
  const Vector3d axis = Vector3d(2, -3, 6) / 7;
  Quaterniond turn(Eigen::AngleAxisd(angle, axis));
  turn.coeffs() *= length;
  const Vector3d vector = ToRotationVector(turn);
  // At half a turn both ways are the shortest.
  const auto is = [&](const Vector3d& one) {
    const double sign = angle < 3.1 ? 1 : std::copysign(1, one.x());
    return (one - sign * angle * axis).norm() <= 1e-14 * angle;
  };
  CHECK(is(vector));
  CHECK(is(ToRotationVector(FromRotationVector(vector))));
}

TEST_CASE("no rotation has no vector, and what is no number stays none") {
  CHECK(ToRotationVector(Quaterniond(1, 0, 0, 0)).isZero(0));
  CHECK(ToRotationVector(Quaterniond(-1, 0, 0, 0)).isZero(0));
  const double nan = std::nan("");
  CHECK(ToRotationVector(Quaterniond(1, nan, 0, 0)).hasNaN());
}

}  // namespace
}  // namespace plumb
