#include "sim/touch.h"

#include <Eigen/Core>
#include <catch2/catch.hpp>
#include <stdexcept>

#include "tests/sim/robots.h"

namespace plumb {
namespace {

TEST_CASE("what a robot touches") {
  const RobotDescription hopper = LoadRobot(SourceFile("robots/hopper"));
  Eigen::VectorXd q = Eigen::VectorXd::Zero(6);
  q.tail(3) << -0.1, -0.1, 0.1;
  q(1) = 1.25;
  CHECK_FALSE(TouchFinder(hopper).Find(q).any());
  q(1) = 1.15;
  CHECK(TouchFinder(hopper).Find(q).ground);
  CHECK_FALSE(TouchFinder(hopper).Find(q).stop);
  q(1) = 2;
  q(4) = 0.01;
  CHECK(TouchFinder(hopper).Find(q).stop);
  CHECK_FALSE(TouchFinder(hopper).Find(q).ground);
  RobotDescription blind = hopper;
  blind.simulation.stop.reset();
  CHECK_FALSE(TouchFinder(blind).Find(q).any());
  CHECK_THROWS_AS(TouchFinder(hopper).Find(q.head(5)), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
