#include "calibrator/diagnostics/identifiability.h"

#include <catch2/catch.hpp>

#include <limits>

#include "calibrator/diagnostics/sparse_basis.h"
#include "common/decompositions.h"
#include "robot/parameter_distribution.h"
#include "tests/calibrator/fitted_log.h"
#include "tests/calibrator/synthetic.h"

namespace plumb {
namespace {

using Coordinate = ParameterDescription::Coordinate;

/// Of the pendulum's gravity, mass and length, and one more parameter whose mean is on its border
/// or beyond sense.
Identifiability Find(const ParameterDescription& extra, const Eigen::VectorXd& truth) {
  RobotDescription robot = Pendulum();
  robot.parameters.push_back(extra);
  robot.virtual_robot.hidden.clear();
  const std::vector<Rollout> rollouts = {SyntheticRollout(robot, truth, 100, 1e-4, 1e-3, 1)};
  Discrepancy discrepancy(robot);
  return FindIdentifiability(robot, discrepancy, rollouts, PriorGaussian(robot));
}

/// A robot of n parameters a0, a1, ... with logarithmic coordinates: only their description
/// matters.
RobotDescription WithSomeParameters(int n) {
  RobotDescription robot{};
  for (int i = 0; i < n; ++i)
    robot.parameters.push_back({"a" + std::to_string(i), "", Coordinate::kLog, 1, 0.01});
  return robot;
}

/// Information of random errors that depend on these combinations only, one a row.
Eigen::MatrixXd InformationOf(const Eigen::MatrixXd& combinations, double size) {
  Random random(3);
  const Eigen::MatrixXd jacobian =
      size * StandardNormals(500, combinations.rows(), random) * combinations;
  return jacobian.transpose() * jacobian;
}

Identifiability FindFrom(const RobotDescription& robot, const Eigen::MatrixXd& information) {
  const Gaussian prior = PriorGaussian(robot);
  return FindIdentifiability(robot, information, prior.covariance.diagonal().cwiseSqrt(), prior);
}

Eigen::VectorXd Powers(Eigen::Index n, const std::vector<std::pair<int, double>>& entries) {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(n);
  for (const auto& [i, power] : entries) x(i) = power;
  return x;
}

bool Has(const std::vector<Eigen::VectorXd>& vectors, const Eigen::VectorXd& vector) {
  return std::any_of(vectors.begin(), vectors.end(),
                     [&](const Eigen::VectorXd& v) { return v == vector; });
}

}  // namespace

TEST_CASE("of forty parameters those coupled are found, and nothing else is said of them") {
  // a3 has no effect; a5 a7^2 and a7 / a11 are all of three; eight from a20 on act as seven
  // products of neighbours.
  const Eigen::Index n = 40;
  std::vector<Eigen::VectorXd> rows = {Powers(n, {{5, 1}, {7, 2}}), Powers(n, {{7, 1}, {11, -1}})};
  for (int i = 20; i < 27; ++i) rows.push_back(Powers(n, {{i, 1}, {i + 1, 1}}));
  for (int i = 0; i < n; ++i) {
    if (i != 3 && i != 5 && i != 7 && i != 11 && (i < 20 || i > 27))
      rows.push_back(Powers(n, {{i, 1}}));
  }
  Eigen::MatrixXd combinations(static_cast<Eigen::Index>(rows.size()), n);
  for (size_t i = 0; i < rows.size(); ++i) combinations.row(static_cast<Eigen::Index>(i)) = rows[i];
  const Identifiability found = FindFrom(WithSomeParameters(40), InformationOf(combinations, 100));
  INFO(found.summary);
  REQUIRE(found.null.size() == 3);
  CHECK(Has(found.null, Powers(n, {{3, 1}})));
  CHECK(Has(found.null, Powers(n, {{5, 2}, {7, -1}, {11, -1}})));
  CHECK(
      Has(found.null,
          Powers(n, {{20, 1}, {21, -1}, {22, 1}, {23, -1}, {24, 1}, {25, -1}, {26, 1}, {27, -1}})));
  CHECK(found.combinations.size() == 37);
  CHECK(found.weak.empty());
  for (const Combination& combination : found.combinations) {
    CHECK(std::abs(combination.power(3)) == 0);
    CHECK((combination.power.array() != 0).count() <= 2);  // neighbours' products
    for (const Eigen::VectorXd& direction : found.null)
      CHECK(std::abs(direction.dot(combination.power)) < 1e-9);
  }
  CHECK_THAT(found.summary, Catch::StartsWith("only 28 parameters on their own and "));
  CHECK_THAT(found.summary, Catch::Contains("; a3 has no effect on this motion"));
  CHECK_THAT(found.summary, Catch::Contains("(a5 +2 %, a7 -1 %, a11 -1 %) changes nothing"));
  for (const int i : {3, 5, 7, 11, 20, 27})
    CHECK(found.cramer_rao(i) == std::numeric_limits<double>::infinity());
  const Eigen::MatrixXd information = InformationOf(combinations, 100);
  CHECK(found.cramer_rao(0) >= 1 / std::sqrt(information(0, 0)));
  CHECK(found.cramer_rao(0) < 2 / std::sqrt(information(0, 0)));
}

TEST_CASE("two null directions of eight parameters come with as few entries as there are") {
  const Eigen::VectorXd a = Powers(8, {{0, 1}, {3, -2}, {6, 1}}),
                        b = Powers(8, {{1, 1}, {3, 1}, {7, 3}});
  Eigen::MatrixXd space(8, 2);
  space << a + 0.3 * b, 0.7 * a - 2 * b;
  const auto belongs = [&](const Eigen::VectorXd& x) {
    return (x - space * space.colPivHouseholderQr().solve(x)).norm() < 1e-6 * x.norm();
  };
  const std::vector<Eigen::VectorXd> basis = SparseBasis(space, Eigen::VectorXd::Ones(8), belongs);
  REQUIRE(basis.size() == 2);
  CHECK(Has(basis, a));
  CHECK(Has(basis, b));
  CHECK(SparseBasis(space.leftCols(0), Eigen::VectorXd::Ones(8), belongs).empty());
}

TEST_CASE("what is hardly determined is told, with what is left of the prior's sd") {
  RobotDescription robot = WithSomeParameters(3);
  const double variance = robot.parameters[0].coordinate_variance();
  Eigen::Vector3d information(1e4, 1e4, 0.16);  // in units of the prior
  SECTION("a parameter") {
    const Identifiability found = FindFrom(robot, (information / variance).asDiagonal());
    INFO(found.summary);
    CHECK(found.null.empty());
    CHECK(found.combinations.size() == 3);
    REQUIRE(found.weak.size() == 1);
    CHECK(found.weak[0].direction == Powers(3, {{2, 1}}));
    CHECK(found.weak[0].sd_ratio == Approx(1 / std::sqrt(1.16)));
    CHECK_THAT(found.summary,
               Catch::Contains("a2 is hardly determined: posterior sd is 93 % of the prior's"));
    CHECK_THAT(found.summary, Catch::StartsWith("every other parameter is determined"));
    CHECK(found.cramer_rao(2) == Approx(std::sqrt(variance / 0.16)));
  }
  SECTION("a direction") {
    Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
    axes.bottomRightCorner(2, 2) << std::sqrt(0.5), std::sqrt(0.5), std::sqrt(0.5), -std::sqrt(0.5);
    const Identifiability found =
        FindFrom(robot, axes * (information / variance).asDiagonal() * axes.transpose());
    INFO(found.summary);
    REQUIRE(found.weak.size() == 1);
    CHECK(std::abs(found.weak[0].direction(0)) < 1e-9);
    CHECK(found.weak[0].direction(1) * found.weak[0].direction(2) == Approx(-1));
    CHECK_THAT(found.summary,
               Catch::Contains("changes little: posterior sd is 93 % of the prior's"));
  }
  SECTION("nothing is weak") {
    information(2) = 2;
    const Identifiability found = FindFrom(robot, (information / variance).asDiagonal());
    CHECK(found.weak.empty());
    CHECK(found.summary == "every parameter is determined by this motion");
  }
  SECTION("no motion at all") {
    const Identifiability found = FindFrom(robot, Eigen::Matrix3d::Zero());
    CHECK(found.null.size() == 3);
    CHECK(found.combinations.empty());
    CHECK(found.summary ==
          "nothing can be known from this motion; a0, a1, a2 have no effect on this motion");
  }
}

TEST_CASE("a little information is no null direction for being small beside much") {
  const double variance = WithSomeParameters(2).parameters[0].coordinate_variance();
  const Identifiability found = FindFrom(
      // 50 times the prior's
      WithSomeParameters(2), (Eigen::Vector2d(1e9, 50) / variance).asDiagonal());
  CHECK(found.null.empty());
  CHECK(found.weak.empty());
}

TEST_CASE("linear parameters move in their unit") {
  RobotDescription robot = WithSomeParameters(1);
  robot.parameters.push_back({"com/leg/x", "m", Coordinate::kLinear, 0.1, 0.01});
  Eigen::MatrixXd combination(1, 2);
  combination << 0.5, 1;  // ln a0 / 2 + x
  const Identifiability found = FindFrom(robot, InformationOf(combination, 10));
  INFO(found.summary);
  REQUIRE(found.null.size() == 1);
  CHECK_THAT(found.summary, Catch::Contains("(a0 +2 %, com -0.01 m) changes nothing") ||
                                Catch::Contains("(a0 +1 %, com -0.005 m) changes nothing"));
}

TEST_CASE("the base's mass has no effect on the hopper, and all others are known") {
  const RobotDescription robot =
      LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/hopper/paper.toml");
  const int world = robot.FindParameter("mass/world");
  REQUIRE(world >= 0);
  Discrepancy discrepancy(robot);
  const std::vector<Rollout> rollouts = RandomLog(robot, {}, 60, 4);
  const Identifiability found =
      FindIdentifiability(robot, discrepancy, rollouts, PriorGaussian(robot));
  CHECK(found.summary ==
        "every other parameter is determined by this motion; mass/world has no effect on this "
        "motion");
  REQUIRE(found.null.size() == 1);
  CHECK(found.null[0] == Powers(5, {{world, 1}}));
  CHECK(found.combinations.size() == 4);
  CHECK(std::isinf(found.cramer_rao(world)));
}

TEST_CASE("a parameter at the border of what is physical does not hide what cannot be known") {
  for (const char* name : {"friction/pivot", "delay/pivot"}) {
    const Identifiability found =
        Find({name, "", Coordinate::kLinear, 0, 1e-6}, Eigen::Vector4d(10, 1, 1, 1e-3));
    INFO(name << ": " << found.summary);
    CHECK(found.information.allFinite());
    CHECK(found.null.size() == 1);
    CHECK_THAT(found.summary,
               Catch::Contains("gravity, mass, length are not identifiable separately"));
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
  const Identifiability found =
      Find({"rest/pivot", "", Coordinate::kLinear, 0, 1}, Eigen::Vector4d(10, 1, 1, 0));
  CHECK(found.null.size() >= 1);  // a spring without stiffness rests anywhere
  RobotDescription robot = Pendulum();
  std::vector<Rollout> rollouts = {
      SyntheticRollout(robot, Eigen::Vector3d(10, 1, 1), 20, 1e-4, 1e-3, 1)};
  rollouts[0].transitions[3].v(0) = 1e200;
  Discrepancy discrepancy(robot);
  const Identifiability blind =
      FindIdentifiability(robot, discrepancy, rollouts, PriorGaussian(robot));
  CHECK(blind.combinations.empty());
  CHECK_THAT(blind.summary, Catch::Contains("fails"));
}

}  // namespace plumb
