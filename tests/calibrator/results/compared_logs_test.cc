// Whether logs are of one robot, as a calibration of several tells it.

#include <catch2/catch.hpp>

#include "tests/calibrator/results/swinging.h"

namespace plumb {
namespace {

TEST_CASE("logs of one robot agree, logs of two do not") {
  const Log a = Swinging("a", kSwingingTruth, 3, 30), b = Swinging("b", kSwingingTruth, 3, 40);
  const Log other = Swinging("other", Eigen::Vector3d(9.5, 1.15, 0.95), 3, 50);
  const Findings same = Of({a, b});
  CHECK(same.agreement.agree);
  REQUIRE(same.agreement.logs.size() == 2);
  CHECK(same.agreement.logs[0].log == "a");
  // of two, each is the other's judge
  CHECK(same.agreement.logs[0].p == Approx(same.agreement.logs[1].p));
  const Findings odd = Of({a, b, other});
  CHECK_FALSE(odd.agreement.agree);
  REQUIRE(odd.agreement.logs.size() == 3);
  CHECK(odd.agreement.logs[2].p < 1e-3);
  CHECK(odd.agreement.logs[2].distance > odd.agreement.logs[0].distance);
  CHECK(odd.agreement.summary.find("other") != std::string::npos);
}

TEST_CASE("logs of one robot seldom disagree by chance") {
  int p_below = 0;
  constexpr int kPairs = 40;
  RobotDescription robot = Pendulum();
  robot.task.steps = 10;  // of the motion that would be advised, which is not the matter here
  for (uint32_t i = 0; i < kPairs; ++i) {
    CalibrationOptions options;
    options.method = "laplace";
    options.horizons = {1};
    const std::vector<Log> logs{Swinging("a", kSwingingTruth, 2, 1000 + 10 * i, 30),
                                Swinging("b", kSwingingTruth, 2, 1005 + 10 * i, 30)};
    // which is 0.1, for two logs
    p_below += Calibrate(robot, logs, options).agreement.logs[0].p < 0.2;
  }
  CHECK(p_below <= 11);  // of 4 expected
}

TEST_CASE("a log that cannot be fitted on its own is named, and leaves nothing to compare with") {
  const Log a = Swinging("a", kSwingingTruth, 3, 30);
  const Log tiny = Swinging("tiny", kSwingingTruth, 1, 60, 1);
  const Findings f = Of({a, tiny});
  REQUIRE_FALSE(f.warnings.empty());
  CHECK(std::any_of(f.warnings.begin(), f.warnings.end(),
                    [](const auto& w) { return w.find("tiny") != std::string::npos; }));
  CHECK(f.agreement.summary.find("the 1 logs") == std::string::npos);
  CHECK(f.agreement.agree);
}

}  // namespace
}  // namespace plumb
