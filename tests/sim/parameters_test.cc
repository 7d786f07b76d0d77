#include "sim/parameters.h"

#include <catch2/catch.hpp>
#include <limits>

#include "tests/sim/robots.h"

namespace plumb {

using Eigen::Vector3d;
using Eigen::VectorXd;

TEST_CASE("parameters become the inertias of a uniform rod") {
  const Parameters parameters(LoadPendulum("robot.toml"));
  InertialModel model = parameters.Nominal();
  CHECK(model.gravity == 10.4);
  CHECK(model.bodies[0].mass == Approx(1.04).epsilon(1e-15));
  const double m = 2.5, l = 0.7;
  parameters.Apply(Vector3d(9, m, l), model);
  CHECK(model.gravity == 9);
  CHECK(model.bodies[0].mass == Approx(m).epsilon(1e-15));
  CHECK(model.bodies[0].center_of_mass.isApprox(Vector3d(0, 0, l / 2), 1e-15));
  const Vector3d moments(m * l * l / 12, m * l * l / 12, 0);
  CHECK((model.bodies[0].inertia - Eigen::Matrix3d(moments.asDiagonal())).norm() < 1e-15);
}

TEST_CASE("parameters that are not physical are refused and change nothing") {
  const Parameters parameters(LoadPendulum("robot.toml"));
  InertialModel model = parameters.Nominal();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  for (const Vector3d& bad : {Vector3d(9, 0, 1), Vector3d(9, 1, -1), Vector3d(-1, 1, 1), Vector3d(9, nan, 1),
                              Vector3d(infinity, 1, 1), Vector3d(9, 1, infinity)}) {
    CHECK_THROWS_AS(parameters.Apply(bad, model), std::invalid_argument);
    CHECK(model.gravity == 10.4);
  }
  CHECK_THROWS_AS(parameters.Apply(Eigen::Vector2d(9, 1), model), std::invalid_argument);
  CHECK_THROWS_WITH(parameters.Apply(Vector3d(9, -3, 1), model),
                    Catch::Contains("mass/pole") && Catch::Contains("-3"));
  CHECK_NOTHROW(parameters.Apply(Vector3d(0, 1, 1), model));  // weightless is physical
}

TEST_CASE("an unknown parameter is answered with the nearest known one") {
  RobotDescription description = LoadPendulum("robot.toml");
  description.parameters[1].name = "mass/pol";
  CHECK_THROWS_WITH(Parameters(description), Catch::Contains("'mass/pol'") && Catch::Contains("'mass/pole'"));
  description.parameters[1].name = "gravty";
  CHECK_THROWS_WITH(Parameters(description), Catch::Contains("'gravity'"));
  description.parameters[1].name = "mass/base";
  CHECK_THROWS_AS(Parameters(description), std::invalid_argument);
}

TEST_CASE("only the last link of a chain has a length, and only one with a lever") {
  RobotDescription tree = MakeTree();
  tree.parameters = {{"length/lower", "m", ParameterDescription::Coordinate::kLog, 0.5, 0.1}};
  CHECK_NOTHROW(Parameters(tree));
  tree.parameters[0].name = "length/upper";
  CHECK_THROWS_WITH(Parameters(tree), Catch::Contains("carries no further joint"));
  tree.parameters[0].name = "length/arm";
  tree.links[4].center_of_mass.setZero();
  CHECK_THROWS_WITH(Parameters(tree), Catch::Contains("no length"));
}

TEST_CASE("without a parameter for it, gravity is the standard one") {
  CHECK(Parameters(MakeTree()).Nominal().gravity == 9.80665);
}

TEST_CASE("hidden parameters lie in their ranges and depend on the seed alone") {
  const RobotDescription description = LoadPendulum("robot.toml");
  VectorXd sum = VectorXd::Zero(3);
  for (uint64_t seed = 0; seed < 1000; ++seed) {
    const VectorXd truth = HiddenParameters(description, seed);
    REQUIRE(truth.size() == 3);
    CHECK((truth.array() >= Eigen::Array3d(9, 0.9, 0.9)).all());
    CHECK((truth.array() <= Eigen::Array3d(11, 1.1, 1.1)).all());
    CHECK(truth == HiddenParameters(description, seed));
    CHECK(truth != HiddenParameters(description, seed + 1));
    sum += truth;
  }
  CHECK(sum[0] / 1000 == Approx(10).margin(0.1));  // 5 standard errors
  CHECK(sum[1] / 1000 == Approx(1).margin(0.01));
  CHECK(sum[2] / 1000 == Approx(1).margin(0.01));

  RobotDescription fewer = description;
  fewer.virtual_robot.hidden = {{"length/pole", 0.9, 1.1}};
  CHECK(HiddenParameters(fewer, 4) == Eigen::Vector3d(10.4, 1.04, HiddenParameters(description, 4)[2]));
}

}  // namespace plumb
