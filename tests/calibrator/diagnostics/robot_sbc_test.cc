#include "calibrator/diagnostics/robot_sbc.h"

#include <catch2/catch.hpp>
#include <memory>

#include "calibrator/inference/laplace.h"
#include "tests/calibrator/synthetic.h"

namespace plumb {
namespace {

TEST_CASE(
    "laplace's posteriors of a linear problem with normal noise of unknown size rank the truth "
    "uniformly") {
  const Prior prior({Prior::Normal(1, 2), Prior::Normal(-1, 0.5)});
  Random design(3, {1});
  const Eigen::MatrixXd slopes = StandardNormals(60, 2, design);
  const std::vector<int> group(60, 0);
  std::vector<int> rows(60);
  for (int i = 0; i < 60; ++i) rows[static_cast<size_t>(i)] = i;
  const auto fit = [&](const Eigen::VectorXd& truth,
                       Random& random) -> std::optional<Eigen::MatrixXd> {
    const Eigen::VectorXd data = slopes * truth + 3 * StandardNormals(60, 1, random);
    const LeastSquares problem{
        prior,
        [&](const Eigen::MatrixXd& x) -> Eigen::MatrixXd { return (slopes * x).colwise() - data; },
        group, rows, rows};
    return Draw(FitLaplace(problem, prior.FromStandard(Eigen::VectorXd::Zero(2))), prior, 99,
                random);
  };
  const SbcResult result = RunSbc(prior, fit, Marginals({"a", "b"}), 500, 7);
  INFO(SbcSummary(result));
  CHECK(result.failures == 0);
  for (const SbcUniformity& quantity : result.quantities) {
    CHECK(quantity.chi2_p > 0.01);
    CHECK(quantity.ecdf_p > 0.01);
  }
}

TEST_CASE(
    "laplace's posteriors of the pendulum rank the truth uniformly, in what the motion tells and "
    "in what it does not") {
  const RobotDescription robot = Pendulum();
  const Eigen::Vector3d truth(10.4, 1.04, 1.04);
  const std::vector<Rollout> rollouts{SyntheticRollout(robot, truth, 60, 0, 0, 3)};
  RobotSbcOptions options;
  options.seed = 11;
  const SbcResult result =
      RunRobotSbc(std::make_shared<Model>(robot), rollouts, Eigen::Vector2d(0.003, 0.01), options);
  INFO(SbcSummary(result));
  CHECK(result.failures == 0);
  REQUIRE(result.quantities.size() == 5);  // three parameters, two combinations
  CHECK(result.quantities[3].name == "gravity / length");
  CHECK(result.quantities[4].name == "mass length^2");
  for (const SbcUniformity& quantity : result.quantities) {
    CHECK(quantity.chi2_p > 0.01);
    CHECK(quantity.ecdf_p > 0.01);
    CHECK(quantity.coverage[2] == Approx(0.95).margin(0.03));
  }
}

}  // namespace
}  // namespace plumb
