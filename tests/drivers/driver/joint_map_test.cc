#include "drivers/driver/joint_map.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace plumb {
namespace {

TEST_CASE("a geared, reversed motor with an offset") {
  MotorDescription motor;
  motor.gear = 9;
  motor.sign = -1;
  motor.offset = 0.3;
  const JointMap map(motor);
  // Nine turns of the motor backwards are one turn of the joint; power is the same on both sides.
  CHECK(map.JointPosition(-9) == Approx(1.3));
  CHECK(map.JointVelocity(18) == Approx(-2));
  CHECK(map.JointEffort(0.5) == Approx(-4.5));
  CHECK(map.JointEffort(0.5) * map.JointVelocity(18) == Approx(0.5 * 18));
  for (const double x : {-3.0, -0.1, 0.0, 2.5}) {
    CHECK(map.MotorPosition(map.JointPosition(x)) == Approx(x).margin(1e-12));
    CHECK(map.MotorVelocity(map.JointVelocity(x)) == Approx(x).margin(1e-12));
    CHECK(map.MotorTorque(map.JointEffort(x)) == Approx(x).margin(1e-12));
  }
}

TEST_CASE("maps that are none") {
  MotorDescription motor;
  motor.gear = 0;
  CHECK_THROWS_AS(JointMap(motor), std::invalid_argument);
  motor.gear = NAN;
  CHECK_THROWS_AS(JointMap(motor), std::invalid_argument);
  motor = {};
  motor.sign = 0;
  CHECK_THROWS_AS(JointMap(motor), std::invalid_argument);
  motor = {};
  motor.offset = INFINITY;
  CHECK_THROWS_AS(JointMap(motor), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
