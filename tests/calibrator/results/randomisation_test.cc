// Tables of simulators and MuJoCo's XML, as files for others.
#include "calibrator/results/randomisation.h"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "calibrator/results/identified_mjcf.h"

namespace plumb {
namespace {

using Catch::Contains;
using Coordinate = ParameterDescription::Coordinate;
using nlohmann::json;

RobotDescription Pendulum(const std::vector<ParameterDescription>& parameters) {
  RobotDescription robot =
      LoadRobot(std::string(std::getenv("PLUMBLINE_SOURCE")) + "/robots/pendulum");
  robot.parameters = parameters;
  robot.virtual_robot.hidden.clear();
  return robot;
}

json Table(const RobotDescription& robot, const RandomisationOptions& options) {
  return json::parse(RandomisationJson(ParameterDistribution::Prior(robot), robot, options));
}

}  // namespace

TEST_CASE("randomisation: a table has what was asked for, and the distribution's moments") {
  const RobotDescription robot = Pendulum({{"mass/pole", "kg", Coordinate::kLinear, 1, 0.01},
                                           {"damping/pivot", "Nm s/rad", Coordinate::kLog, 2, 1}});
  ParameterDistribution distribution = ParameterDistribution::Prior(robot);
  // Tied to one another: the logarithm goes with the mass.
  Eigen::MatrixXd& covariance = distribution.mixture.components[0].covariance;
  covariance(0, 1) = covariance(1, 0) = 0.8 * std::sqrt(covariance(0, 0) * covariance(1, 1));
  const json table =
      json::parse(RandomisationJson(distribution, robot, {4000, 7, "posterior.json"}));
  CHECK(table["format"] == "plumbline randomisation");
  CHECK(table["version"] == 1);
  CHECK(table["robot"] == robot.name);
  CHECK(table["source"] == "posterior.json");
  CHECK(table["residual"] == false);
  CHECK(table["names"] == json{"mass/pole", "damping/pivot"});
  CHECK(table["units"] == json{"kg", "Nm s/rad"});
  CHECK(table["mean"][0].get<double>() == Approx(1));
  CHECK(table["mean"][1].get<double>() == Approx(2));
  CHECK(table["sd"][1].get<double>() == Approx(1));
  CHECK(table["covariance"][0][0].get<double>() == Approx(0.01));
  CHECK(table["covariance"][1][1].get<double>() == Approx(1));
  // Of x and exp(m + s z), with z tied to x by r: r s sd(x) mean of the log-normal.
  const double s = std::sqrt(covariance(1, 1)), exact = 0.8 * s * 0.1 * 2;
  CHECK(table["covariance"][0][1].get<double>() == Approx(exact).epsilon(0.03));
  CHECK(table["covariance"][1][0] == table["covariance"][0][1]);
  REQUIRE(table["samples"].size() == 4000);
  Eigen::MatrixXd samples(4000, 2);
  for (Eigen::Index i = 0; i < 4000; ++i)
    for (Eigen::Index k = 0; k < 2; ++k)
      samples(i, k) = table["samples"][static_cast<size_t>(i)][static_cast<size_t>(k)];
  const Eigen::RowVectorXd mean = samples.colwise().mean();
  CHECK(mean(0) == Approx(1).margin(0.01));
  CHECK(mean(1) == Approx(2).margin(0.1));
  const Eigen::MatrixXd centred = samples.rowwise() - mean;
  CHECK(centred.col(0).dot(centred.col(1)) / 4000 == Approx(exact).epsilon(0.1));
}

TEST_CASE("randomisation: the seed says which samples, and nothing else does") {
  const RobotDescription robot = Pendulum({{"mass/pole", "kg", Coordinate::kLinear, 1, 0.01}});
  CHECK(Table(robot, {5, 1, ""}) == Table(robot, {5, 1, ""}));
  CHECK(Table(robot, {5, 1, ""})["samples"] != Table(robot, {5, 2, ""})["samples"]);
  // A longer table begins as a shorter one.
  const json longer = Table(robot, {9, 1, ""})["samples"];
  CHECK(json(std::vector<json>(longer.begin(), longer.begin() + 5)) ==
        Table(robot, {5, 1, ""})["samples"]);
}

TEST_CASE("randomisation: what no robot can have is drawn again, or refused") {
  const RobotDescription wide = Pendulum({{"mass/pole", "kg", Coordinate::kLinear, 0.5, 1}});
  const json table = Table(wide, {500, 1, ""});
  for (const json& sample : table["samples"]) CHECK(sample[0].get<double>() > 0);
  std::vector<ParameterDescription> as_often_below_zero;
  for (const char* name : {"gravity", "mass/pole", "length/pole", "damping/pivot", "friction/pivot",
                           "armature/pivot", "gain/pivot", "delay/pivot"})
    as_often_below_zero.push_back({name, "", Coordinate::kLinear, 1e-3, 1});
  CHECK_THROWS_WITH(Table(Pendulum(as_often_below_zero), {5, 1, ""}),
                    Contains("draw in a hundred") && Contains("coordinate"));
  CHECK_THROWS_WITH(Table(Pendulum({}), {5, 1, ""}), Contains("no uncertain parameters"));
  CHECK_THROWS_WITH(Table(wide, {0, 1, ""}), Contains("one sample"));
}

TEST_CASE("identified.xml: says what is in it, and what is not") {
  const RobotDescription robot = Pendulum({{"mass/pole", "kg", Coordinate::kLinear, 1, 0.01},
                                           {"delay/pivot", "s", Coordinate::kLinear, 0.01, 0.001}});
  const std::string text =
      IdentifiedMjcf(robot, Eigen::Vector2d(1.25, 0.02), Eigen::Vector2d(0.1, 0.001), true);
  CHECK_THAT(text, Contains("mass/pole = 1.25 kg, sd 0.1 kg"));
  CHECK_THAT(text, Contains("no place for:\n       delay/pivot = 0.02 s"));
  CHECK_THAT(text, Contains("residual"));
  CHECK_THAT(text, Contains("mass=\"1.25\""));
  CHECK_THAT(IdentifiedMjcf(robot, Eigen::Vector2d(1.25, 0), Eigen::Vector2d(0.1, 0.001)),
             !Contains("residual"));
  CHECK_THROWS_WITH(IdentifiedMjcf(robot, Eigen::Vector2d(-1, 0), Eigen::Vector2d(1, 1)),
                    Contains("mass/pole"));
}

}  // namespace plumb
