#include "calibrator/fit/methods.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <sstream>
#include <stdexcept>

#include "calibrator/fit/likelihood_methods.h"
#include "calibrator/fit/robot_problem.h"
#include "robot/parameter_distribution.h"
#include "tests/calibrator/fitted_log.h"

namespace plumb {
namespace {

TEST_CASE("docs/inference.md has a row for each method, with the help's words") {
  const std::string file = std::string(std::getenv("PLUMBLINE_SOURCE")) + "/docs/inference.md";
  const std::string docs = (std::stringstream() << std::ifstream(file).rdbuf()).str();
  for (const Method& method : Methods()) {
    CAPTURE(method.name);
    CHECK_THAT(docs, Catch::Contains("| `" + method.name + "` | " + method.help + " |"));
  }
}

TEST_CASE("a method that is none is refused, naming the nearest") {
  CHECK_NOTHROW(RequireMethod("abc-smc"));
  CHECK_THROWS_WITH(RequireMethod("lapalce"),
                    "there is no method 'lapalce'; did you mean 'laplace'?");
  for (const std::string& name : RobotDiscrepancies()) CHECK_NOTHROW(RequireDiscrepancy(name));
  CHECK_THROWS_WITH(RequireDiscrepancy("nonsense"), Catch::Contains("nonsense"));
}

TEST_CASE("a budget beyond 32 bits is one") {
  struct Searching {};
  const RobotDescription robot = Robot("pendulum");
  const auto model = std::make_shared<Model>(robot);
  const auto log = RandomLog(robot, {}, 20, 3);
  for (const char* method : {"simopt", "reps"}) {
    for (int bits = 40; bits <= 50; ++bits) {
      CAPTURE(method, bits);
      CalibrationOptions options;
      options.method = method, options.budget = int64_t{1} << bits;
      options.progress = [](const std::string&, double share) {
        if (share > 0 && share < 1) throw Searching();
      };
      CHECK_THROWS_AS(RunMethod({model, log, options}), Searching);
    }
  }
}

TEST_CASE("a distance of errors is not led to a zero that no simulator has") {
  const RobotDescription robot = Robot("pendulum");
  const auto model = std::make_shared<Model>(robot);
  const std::vector<Rollout> log = RandomLog(robot, {{}, 1e-3, 5e-3}, 300, 3);
  const Eigen::VectorXd truth = HiddenParameters(robot, 3);
  for (const char* discrepancy : {"squared", "energy"}) {
    CalibrationOptions options;
    options.method = "abc-rejection", options.discrepancy = discrepancy;
    options.budget = 1'000'000;
    const Gaussian posterior = Moments(RunMethod({model, log, options}).posterior);
    for (Eigen::Index i = 0; i < truth.size(); ++i) {
      const ParameterDescription& p = robot.parameters[static_cast<size_t>(i)];
      const double off = posterior.mean(i) - p.ToCoordinate(truth(i)),
                   sd = std::sqrt(posterior.covariance(i, i));
      CAPTURE(discrepancy, p.name, posterior.mean(i), off, sd);
      CHECK(std::abs(off) < 2 * sd);
    }
  }
}

TEST_CASE("the fit that approximate Bayesian computation begins with leaves it its simulators") {
  const RobotDescription robot = Robot("pendulum");
  const auto model = std::make_shared<Model>(robot);
  const std::vector<Rollout> log = RandomLog(robot, {{}, 1e-3, 5e-3}, 600, 3);
  CalibrationOptions options;
  options.method = "laplace";
  const Gaussian exact = Moments(RunMethod({model, log, options}).posterior);
  const Gaussian prior = PriorGaussian(robot);
  for (const char* method : {"abc-rejection", "abc-smc", "conditional-mixture"}) {
    CAPTURE(method);
    options.method = method;
    const MethodResult result = RunMethod({model, log, options});
    CAPTURE(result.check);
    const Gaussian posterior = Moments(result.posterior);
    // Of each parameter no less is known than before, and no more than there is to be known.
    const Eigen::VectorXd sd = posterior.covariance.diagonal().cwiseSqrt();
    CHECK((sd.array() > 0.5 * exact.covariance.diagonal().cwiseSqrt().array()).all());
    CHECK((sd.array() < 1.2 * prior.covariance.diagonal().cwiseSqrt().array()).all());
    CHECK(posterior.covariance.determinant() < 0.3 * prior.covariance.determinant());
    for (const std::string& warning : result.warnings)
      CHECK_THAT(warning, !Catch::Contains("give more"));
  }
  options.method = "abc-rejection", options.budget = 100;
  CHECK_THAT(RunMethod({model, log, options}).warnings.back(),
             Catch::Contains("100 simulators, where 3000 are few: give more"));
}

TEST_CASE("how well parameters are determined is a guess where hardly a sample counts") {
  CHECK_THAT(Doubt("mixture", 1.04, 15), Catch::Contains("(1.0 of them count)"));
  CHECK(!Doubt("mixture", 19.9, 3).empty());
  CHECK(Doubt("mixture", 20, 3).empty());  // five for each parameter, and five
  CHECK(Doubt("laplace", std::numeric_limits<double>::quiet_NaN(), 15).empty());
  CHECK(Doubt("reps", 1.04, 15).empty());  // a search's samples say nothing of a likelihood
}

}  // namespace
}  // namespace plumb
