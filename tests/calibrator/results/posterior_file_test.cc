#include "calibrator/results/posterior_file.h"

#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "calibrator/results/summary.h"
#include "robot/posterior_reader.h"
#include "robot/residual_json.h"
#include "tests/calibrator/sample_findings.h"
#include "tests/calibrator/synthetic.h"
#include "tests/sim/robots.h"
#include "tests/temporary_file.h"

namespace plumb {
namespace {

using Catch::Contains;
using nlohmann::json;

TEST_CASE("a posterior reads back to the same bits") {
  const RobotDescription robot = Pendulum();
  const Findings findings = SampleFindings(robot);
  const TemporaryFile file("", ".json");
  WritePosterior(file.path(), findings, robot, SampleProvenance());
  const ParameterDistribution read = ReadPosterior(file.path(), robot);
  CHECK(read.mixture.components.size() == 2);
  CHECK(read.mixture == findings.posterior);
  CHECK(read.parameters.size() == 3);
  CHECK(read.iteration == 1);
}

TEST_CASE("a residual and starts read back to the same bits") {
  const RobotDescription robot = Pendulum();
  Findings findings = SampleFindings(robot);
  findings.starts = {Eigen::Vector2f(0.1f, -1e-7f).cast<double>(), Eigen::Vector2d(3, 0)};
  const Residual& residual = *findings.gap.residual;
  const TemporaryFile file(PosteriorJson(findings, robot, {}), ".json");
  const ParameterDistribution read = ReadPosterior(file.path(), robot);
  CHECK(read.starts == findings.starts);
  REQUIRE(read.residual);
  CHECK(read.residual->coordinates == residual.coordinates);
  CHECK(read.residual->margin == residual.margin);
  CHECK_FALSE(read.residual->free);
  CHECK_FALSE(read.residual->stop);
  for (const auto part : {&Residual::touching, &Residual::ground}) {
    REQUIRE((*read.residual).*part);
    const ResidualFunction &is = *((*read.residual).*part), &was = *(residual.*part);
    CHECK(is.mean == was.mean);
    CHECK(is.scale == was.scale);
    CHECK(is.low == was.low);
    CHECK(is.high == was.high);
    CHECK(is.centres == was.centres);
    CHECK(is.weights == was.weights);
    CHECK(is.noise == was.noise);
    CHECK(is.bound == was.bound);
  }
}

TEST_CASE("a robot with a floating base has one position more than velocities, and reads back") {
  const RobotDescription robot = LoadRobot(SourceFile("robots/quadruped/robot.toml"));
  REQUIRE(robot.num_positions() == robot.num_velocities() + 1);
  Findings findings = SampleFindings(robot);
  Eigen::VectorXd start = Eigen::VectorXd::Zero(robot.num_positions() + robot.num_velocities());
  start(3) = 1;  // the quaternion's w
  findings.starts = {start};
  const TemporaryFile file(PosteriorJson(findings, robot, {}), ".json");
  const ParameterDistribution read = ReadPosterior(file.path(), robot);
  CHECK(read.starts == findings.starts);
  REQUIRE(read.residual);
  REQUIRE(read.residual->touching);
  CHECK(read.residual->touching->weights == findings.gap.residual->touching->weights);
}

TEST_CASE("of the version before residuals a posterior has none") {
  const RobotDescription robot = Pendulum();
  json old = json::parse(PosteriorJson(SampleFindings(robot), robot, {}));
  old["version"] = 1;
  old.erase("residual"), old.erase("starts"), old.erase("gap");
  const TemporaryFile file(old.dump(), ".json");
  const ParameterDistribution read = ReadPosterior(file.path(), robot);
  CHECK_FALSE(read.residual);
  CHECK(read.starts.empty());
}

TEST_CASE("a single-precision number is written with as few digits as tell it") {
  CHECK(ShortestSingle(0.1f) == 0.1);
  CHECK(ShortestSingle(1.0 / 3) == 0.33333334);
  CHECK(ShortestSingle(-0.0) == 0);
  Random random(4);
  for (int i = 0; i < 100'000; ++i) {
    const auto single = std::bit_cast<float>(random.Bits());  // of any size
    if (!std::isfinite(single)) continue;
    if (static_cast<float>(ShortestSingle(single)) != single) FAIL(single);
  }
}

TEST_CASE("the file says what was found") {
  const RobotDescription robot = Pendulum();
  const Findings findings = SampleFindings(robot);
  const Summary summary = Summarise(findings, robot);
  const json j = json::parse(PosteriorJson(findings, robot, SampleProvenance()));
  CHECK(j["names"] == json({"gravity", "mass/pole", "length/pole"}));
  CHECK(j["units"] == json({"m/s^2", "kg", "m"}));
  CHECK(j["coordinates"][0] == json{{"kind", "log"}});
  CHECK(j["seed"] == 0xfedcba9876543210);
  CHECK(j["prior"]["mean"][0].get<double>() == Approx(10.4));
  CHECK(j["prior"]["sd"][0].get<double>() == Approx(std::sqrt(0.33)));
  CHECK(j["prior"]["coordinate_mean"][2] == findings.prior.mean(2));
  REQUIRE(j["samples"].size() == 1000);  // of 1500
  CHECK(j["samples"][999][1] == findings.samples(1, 1498));
  for (size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    CHECK(j["mean"][i] == summary.mean(k));
    CHECK(summary.mean(k) == Approx(findings.samples.row(k).mean()).epsilon(1e-12));
    CHECK(j["covariance"][i][i].get<double>() == Approx(std::pow(j["sd"][i].get<double>(), 2)));
    // As many beyond the quantiles as there should be.
    const auto outside =
        (findings.samples.row(k).array() < j["interval_95"][i][0].get<double>()).count() +
        (findings.samples.row(k).array() > j["interval_95"][i][1].get<double>()).count();
    CHECK(outside == Approx(75).margin(2));
  }
  CHECK(j["coordinate_covariance"][0][1] == summary.coordinates.covariance(0, 1));
  CHECK(j["alarm"]["raised"] == true);
  CHECK(j["alarm"]["misfits"][0]["effect"] == 0.31);
  CHECK(j["alarm"]["misfits"][1]["effect"].is_null());
  CHECK(j["identifiability"]["cramer_rao"][0].is_null());
  CHECK(j["identifiability"]["cramer_rao"][1] == findings.cramer_rao(1));
  CHECK(j["identifiability"]["null"][0]["moves"]["mass/pole"] ==
        findings.identifiability.null[0](1));
  CHECK(j["identifiability"]["combinations"][0]["sd"] == 0.02);
  CHECK(j["gap"]["informed"] == "free");
  CHECK(j["gap"]["free"].is_null());
  CHECK(j["gap"]["touching"]["explained"][0].get<double>() == Approx(0.75));
  CHECK(j["gap"]["touching"]["transitions"] == 295);
  CHECK(j["holdout"]["better"] == true);
  CHECK(j["holdout"]["errors"][2]["prior"] == 0.12);
  CHECK(j["holdout"]["errors"][3]["posterior"].is_null());
  CHECK(j["agreement"]["logs"][1]["log"] == "tuesday.lcm");
  CHECK(j["stages"].size() == 3);
  CHECK(j["simulations"]["failures"] == 2);
  CHECK(j["method"] == json{{"asked", "auto"}, {"used", "smc"}});
  CHECK(j["versions"]["plumbline"].get<std::string>().starts_with("plumb "));
}

TEST_CASE("what differs between runs is at the end, and all else is the same to the byte") {
  const RobotDescription robot = Pendulum();
  Findings findings = SampleFindings(robot);
  Provenance provenance = SampleProvenance();
  const std::string first = PosteriorJson(findings, robot, provenance);
  findings.seconds *= 2;
  provenance.date = "another day", provenance.command += " --threads 3";
  const std::string second = PosteriorJson(findings, robot, provenance);
  CHECK(first != second);
  const size_t run = first.find("\n \"run\": ");
  REQUIRE(run != std::string::npos);
  CHECK(first.substr(0, run) == second.substr(0, run));
  CHECK(std::count(first.begin() + static_cast<std::ptrdiff_t>(run), first.end(), '\n') < 8);
}

TEST_CASE("without samples the numbers are drawn from the mixture") {
  const RobotDescription robot = Pendulum();
  Findings findings = SampleFindings(robot);
  findings.samples.resize(0, 0);
  const Summary summary = Summarise(findings, robot);
  const ParameterDistribution exact{1, robot.parameters, findings.posterior};
  const Eigen::VectorXd error = (summary.mean - exact.Mean()).cwiseQuotient(exact.Sd());
  CHECK(error.cwiseAbs().maxCoeff() < 5 / std::sqrt(4000));
  CHECK((summary.sd.cwiseQuotient(exact.Sd()).array() - 1).abs().maxCoeff() < 0.1);
  CHECK(Summarise(findings, robot).mean == summary.mean);
}

TEST_CASE("findings that are none are not written") {
  const RobotDescription robot = Pendulum();
  const auto why = [&](const std::function<void(Findings&)>& spoil) -> std::string {
    Findings findings = SampleFindings(robot);
    spoil(findings);
    try {
      PosteriorJson(findings, robot, {});
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
    return "";
  };
  CHECK_THAT(why([](Findings& f) { f.posterior.components[1].covariance.resize(0, 0); }),
             Contains("component 1"));
  CHECK_THAT(why([](Findings& f) { f.posterior.components[0].covariance(1, 1) *= -1; }),
             Contains("positive definite"));
  CHECK_THAT(why([](Findings& f) { f.posterior.components[0].mean(2) = NAN; }),
             Contains("not finite"));
  CHECK_THAT(why([](Findings& f) { f.posterior.weights[0] = 0.8; }), Contains("sum to 1.1"));
  CHECK_THAT(why([](Findings& f) { f.posterior.weights.pop_back(); }), Contains("1 weights of 2"));
  CHECK_THAT(why([](Findings& f) { f.posterior = {}; }), Contains("0 components"));
  CHECK_THAT(why([](Findings& f) { f.prior.mean.resize(2); }), Contains("the prior"));
  CHECK_THAT(why([](Findings& f) { f.samples(1, 7) = INFINITY; }),
             Contains("samples are not finite"));
  CHECK_THAT(why([](Findings& f) { f.samples = Eigen::MatrixXd::Ones(2, 9); }),
             Contains("samples are not of 3"));
  CHECK(why([](Findings& f) { f.discrepancy = NAN, f.cramer_rao.setConstant(INFINITY); }) == "");
}

TEST_CASE("diagnostics without numbers, and names that are not UTF-8, still make a JSON file") {
  const RobotDescription robot = Pendulum();
  Findings findings = SampleFindings(robot);
  findings.discrepancy = NAN;
  findings.identifiability = {}, findings.holdout = {}, findings.misspecification = {},
  findings.agreement = {};
  findings.cramer_rao.resize(0), findings.noise_sd.resize(0), findings.stages.clear();
  findings.warnings = {"quote \" backslash \\ newline \n and \xff"};
  const json j = json::parse(PosteriorJson(findings, robot, {{"\xc3\x28.lcm"}, {}, "", ""}));
  CHECK(j["discrepancy"].is_null());
  CHECK(j["stages"] == json::array());
  std::vector<Log> logs(1);
  logs[0].name = "a\x1b[31m\nb.csv";
  const Provenance provenance = ProvenanceOf(logs, {}, "plumb \x1b[2J", 0);
  CHECK(provenance.logs[0] == "a\uFFFD[31m b.csv");
  CHECK(provenance.command == "plumb \uFFFD[2J");
  CHECK(j["warnings"][0].get<std::string>().starts_with("quote \" backslash \\ newline \n and "));
}

}  // namespace
}  // namespace plumb
