#include "calibrator/diagnostics/log_agreement.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace plumb {
namespace {

// Of a prior N(0, 2^2) and data that say `mode`, with so much information.
LogFit Fit(const std::string& log, double mode, double information) {
  LogFit fit;
  fit.log = log;
  const double precision = information + 0.25;
  fit.fit.mode = Eigen::VectorXd::Constant(1, information * mode / precision);
  fit.fit.posterior = {fit.fit.mode, Eigen::MatrixXd::Constant(1, 1, 1 / precision)};
  return fit;
}

TEST_CASE("logs are as far apart as the modes of their likelihoods, in both deviations together") {
  RobotDescription robot{};
  robot.parameters = {{"offset", "rad", ParameterDescription::Coordinate::kLinear, 0, 4}};
  const Gaussian prior{Eigen::VectorXd::Zero(1), Eigen::MatrixXd::Constant(1, 1, 4)};
  const Agreement near =
      CompareLogs(robot, prior, std::vector{Fit("a", 1, 100), Fit("b", 1.2, 25)});
  CHECK(near.agree);
  REQUIRE(near.logs.size() == 2);
  // sqrt(1 / 100 + 1 / 25) apart by 0.2
  for (const LogAgreement& log : near.logs) CHECK(log.distance == Approx(0.2 / std::sqrt(0.05)));
  // two-sided normal tail, twice
  CHECK(near.logs[0].p == Approx(2 * std::erfc(0.2 / std::sqrt(0.05) / std::sqrt(2))));
  CHECK(near.summary == "the 2 logs agree");

  const Agreement far = CompareLogs(robot, prior, std::vector{Fit("a", 1, 100), Fit("b", 3, 25)});
  CHECK_FALSE(far.agree);
  CHECK_THAT(far.summary, Catch::Contains("a (8.9 sd), b (8.9 sd)"));

  // What tells less than the prior is in no one's way.
  const Agreement vague =
      CompareLogs(robot, prior, std::vector{Fit("a", 1, 100), Fit("b", 9, 0.1)});
  CHECK(vague.logs[1].distance == 0);
  CHECK(vague.agree);
  CHECK_THAT(CompareLogs(robot, prior, std::vector{Fit("a", 1, 1)}).summary,
             Catch::Contains("nothing to compare"));
}

}  // namespace
}  // namespace plumb
