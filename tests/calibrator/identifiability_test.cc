#include "calibrator/identifiability.h"

#include <catch2/catch.hpp>

#include "tests/calibrator/synthetic.h"

namespace plumb {
namespace {

using Coordinate = ParameterDescription::Coordinate;

/// Of the pendulum's gravity, mass and length, and one more parameter whose mean is on its border or beyond sense.
Identifiability Find(const ParameterDescription& extra, const Eigen::VectorXd& truth) {
  RobotDescription robot = Pendulum();
  robot.parameters.push_back(extra);
  robot.virtual_robot.hidden.clear();
  const std::vector<Rollout> rollouts = {SyntheticRollout(robot, truth, 100, 1e-4, 1e-3, 1)};
  Discrepancy discrepancy(robot);
  return FindIdentifiability(robot, discrepancy, rollouts, PriorGaussian(robot));
}

}  // namespace

TEST_CASE("a parameter at the border of what is physical does not hide what cannot be known") {
  for (const char* name : {"friction/pivot", "delay/pivot"}) {
    const Identifiability found =
        Find({name, "", Coordinate::kLinear, 0, 1e-6}, Eigen::Vector4d(10, 1, 1, 1e-3));
    INFO(name << ": " << found.words);
    CHECK(found.information.allFinite());
    CHECK(found.null.size() == 1);
    CHECK_THAT(found.words, Catch::Contains("gravity, mass, length are not identifiable separately"));
  }
}

TEST_CASE("a logit parameter on its own is told in its own units") {
  ParameterDescription friction{"friction/pivot", "Nm", Coordinate::kLogit, 0.1, 1e-3};
  friction.lower = 0;
  friction.upper = 0.5;
  const Identifiability found = Find(friction, Eigen::Vector4d(10, 1, 1, 0.1));
  bool told = false;
  for (const Combination& combination : found.combinations) {
    if (combination.power(3) != 1 || combination.power.cwiseAbs().sum() != 1) continue;
    told = true;
    CHECK(combination.mean == Approx(0.1).epsilon(1e-6));
    CHECK(combination.sd == Approx(std::sqrt(1e-3)).epsilon(1e-3));  // of the prior, to first order
  }
  CHECK(told);
}

TEST_CASE("where simulation fails nothing is said to be known") {
  const Identifiability found = Find({"rest/pivot", "", Coordinate::kLinear, 0, 1}, Eigen::Vector4d(10, 1, 1, 0));
  CHECK(found.null.size() >= 1);  // a spring without stiffness rests anywhere
  RobotDescription robot = Pendulum();
  std::vector<Rollout> rollouts = {SyntheticRollout(robot, Eigen::Vector3d(10, 1, 1), 20, 1e-4, 1e-3, 1)};
  rollouts[0].transitions[3].v(0) = 1e200;
  Discrepancy discrepancy(robot);
  const Identifiability blind = FindIdentifiability(robot, discrepancy, rollouts, PriorGaussian(robot));
  CHECK(blind.combinations.empty());
  CHECK_THAT(blind.words, Catch::Contains("fails"));
}

}  // namespace plumb
