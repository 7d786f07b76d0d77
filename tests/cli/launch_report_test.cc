#include "cli/launch_report.h"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <string>

#include "robot/urdf/xml.h"
#include "tests/cli/sample_summary.h"
#include "tests/sim/robots.h"

namespace plumb {
namespace {

using Catch::Contains;

size_t Count(const std::string& text, const std::string& what) {
  size_t count = 0;
  for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++count;
  return count;
}

TEST_CASE("a run's report says which policy runs and why, and what was learnt") {
  const std::string page =
      LaunchReport(LoadPendulum("robot.toml"), SampleSummary(), "plumb launch --seed 7");
  CHECK_NOTHROW(Xml(page, "page"));
  for (const char* words :
       {"Run of pendulum", "2 iterations on loop:, in virtual time, seed 7",
        "Policy 0 runs since iteration 0", "policy 0 is the first (-1357)",
        "Mean -1400, median -1400, worst -1500 of 3 roll-outs.",
        "The model does not explain the robot", "friction", "What it lacks", "explains 83 %",
        "only gravity / length can be known", "policy 1 not accepted", "12 %",
        "10.30 \xc2\xb1 0.20", "10.25", "0.49 %", "9.600 \xc2\xb1 0.020", "plumb launch --seed 7",
        "45 s: 30 s on the robot, 12 s training, 3 s for the rest"})
    CHECK_THAT(page, Contains(words));
  // Returns, three parameters, prediction.
  CHECK(Count(page, "<svg ") - Count(page, "<svg x=") >= 5);
  CHECK_THAT(page, !Contains("50 %"));  // of the first policy, which has nobody before it
  CHECK_THAT(page, !Contains("nan"));
  CHECK_THAT(page, !Contains("dropped"));
}

TEST_CASE("a run without any policy says nothing of one") {
  nlohmann::json summary = SampleSummary();
  summary["policy"] = nullptr;
  summary["decisions"] = summary["evaluation_returns"] = nlohmann::json::array();
  const std::string page = LaunchReport(LoadPendulum("robot.toml"), summary, "");
  CHECK_NOTHROW(Xml(page, "page"));
  CHECK_THAT(page, !Contains("runs since") && !Contains("Policies"));
  CHECK_THAT(page, Contains("10.30 \xc2\xb1 0.20"));
}

TEST_CASE("policies and iterations of a run that went on keep their numbers") {
  nlohmann::json summary = SampleSummary();
  for (nlohmann::json& iteration : summary["iterations"])
    iteration["iteration"] = iteration["iteration"].get<int>() + 30;
  for (nlohmann::json& decision : summary["decisions"])
    decision["policy"] = decision["policy"].get<int>() + 30;
  const std::string page = LaunchReport(LoadPendulum("robot.toml"), summary, "");
  const auto drawing = [&](const std::string& label) {
    const size_t begin = page.find(label);
    REQUIRE(begin != std::string::npos);
    return page.substr(begin, page.find("</svg>", begin) - begin);
  };
  for (const char* policy : {">30<", ">31<", ">32<"})
    CHECK_THAT(drawing("returns of the policies"), Contains(policy));
  CHECK_THAT(drawing("returns of the policies"), !Contains(">0<"));
  CHECK_THAT(drawing("what was learnt of gravity"), Contains(">30<"));
}

TEST_CASE("in a run's report, what is not known is left out or a dash") {
  nlohmann::json summary = SampleSummary();
  summary["hidden"] = nullptr;
  summary["evaluation_returns"] = nlohmann::json::array();
  summary["decisions"][1]["return"] = summary["decisions"][1]["probability"] = nullptr;
  summary["iterations"][0]["simulated_return"] = nullptr;
  summary["iterations"][1]["alarm"] = summary["iterations"][1]["gap"] = "";
  summary["dropped_episodes"] = 5, summary["rearms"] = 2;
  const std::string page = LaunchReport(LoadPendulum("robot.toml"), summary, "");
  CHECK_NOTHROW(Xml(page, "page"));
  CHECK_THAT(page, !Contains("nan"));
  CHECK_THAT(page, Contains("The model explains the robot"));
  CHECK_THAT(page, Contains("5 episodes of training were dropped"));
  CHECK_THAT(page, Contains("armed 2 times after a fault"));
  CHECK_THAT(page, !Contains("What it returns on the robot"));

  summary["iterations"] = nlohmann::json::array();
  summary["decisions"] = nlohmann::json::array();
  CHECK_NOTHROW(Xml(LaunchReport(LoadPendulum("robot.toml"), summary, ""), "page"));
}

}  // namespace
}  // namespace plumb
