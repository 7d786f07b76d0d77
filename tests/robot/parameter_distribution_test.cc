#include "robot/parameter_distribution.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

namespace plumb {
namespace {

RobotDescription Robot() {
  RobotDescription robot{};
  robot.name = "test robot";
  robot.parameters = {{"gravity", "m/s^2", ParameterDescription::Coordinate::kLog, 10.4, .33},
                      {"offset", "rad", ParameterDescription::Coordinate::kLinear, -.2, .01}};
  return robot;
}

parameter_distribution_t TwoComponents() {
  ParameterDistribution distribution = ParameterDistribution::Prior(Robot());
  Gaussian second = distribution.mixture.components[0];
  distribution.mixture.weights = {.25, .75};
  second.mean << std::log(9.), .3;
  second.covariance << .04, .006, .006, .01;
  distribution.mixture.components.push_back(second);
  distribution.iteration = 3;
  return distribution.ToMessage();
}

TEST_CASE("The prior has the description's mean and variance in physical units") {
  const ParameterDistribution prior = ParameterDistribution::Prior(Robot());
  CHECK(prior.iteration == 0);
  CHECK(prior.Mean()[0] == Approx(10.4).epsilon(1e-12));
  CHECK(prior.Sd()[0] == Approx(std::sqrt(.33)).epsilon(1e-9));
  CHECK(prior.Mean()[1] == Approx(-.2));
  CHECK(prior.Sd()[1] == Approx(.1));
}

TEST_CASE("The nominal simulator is that of the prior's means, in physical units") {
  const ParameterDistribution nominal = ParameterDistribution::Nominal(Robot());
  Random random(1);
  const Eigen::VectorXd drawn = nominal.Sample(random);
  CHECK(drawn[0] == Approx(10.4).epsilon(1e-12));
  CHECK(drawn[1] == Approx(-.2));
  CHECK(nominal.Sd().isZero());
}

TEST_CASE("Samples have the distribution's moments, also those of a correlated mixture") {
  const ParameterDistribution distribution =
      ParameterDistribution::FromMessage(TwoComponents(), Robot());
  const int count = 100000;
  Random random(7, {1});
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(2), squares = Eigen::VectorXd::Zero(2);
  double product = 0;
  for (int i = 0; i < count; ++i) {
    const Eigen::VectorXd x = distribution.Sample(random);
    sum += x;
    squares += x.cwiseAbs2();
    product += std::log(x[0]) * x[1];
  }
  const Eigen::VectorXd mean = sum / count;
  const Eigen::VectorXd sd = (squares / count - mean.cwiseAbs2()).cwiseSqrt();
  for (int i = 0; i < 2; ++i) {
    CHECK(mean[i] ==
          Approx(distribution.Mean()[i]).margin(4 * distribution.Sd()[i] / std::sqrt(count)));
    CHECK(sd[i] == Approx(distribution.Sd()[i]).epsilon(.02));
  }
  // E[xy] = sum of weight * (covariance + product of means), in coordinates.
  const double prior_mean = Robot().parameters[0].coordinate_mean();
  CHECK(product / count ==
        Approx(.25 * prior_mean * -.2 + .75 * (.006 + std::log(9.) * .3)).margin(.02));
}

TEST_CASE("Equal names of the generator give equal simulators") {
  const ParameterDistribution prior = ParameterDistribution::Prior(Robot());
  Random a(1, {2, 3}), b(1, {2, 3}), c(1, {2, 4});
  const Eigen::VectorXd x = prior.Sample(a);
  CHECK(x == prior.Sample(b));
  CHECK(x != prior.Sample(c));
}

// Against integrals over the density of the parameter itself, p = lower + width y:
// p(y) = N(logit y; m, s) / (y (1 - y)).
TEST_CASE("A logit parameter's moments, samples and code") {
  RobotDescription robot = Robot();
  robot.parameters[1] = {"friction", "", ParameterDescription::Coordinate::kLogit, .7, .02,
                         .2,         1.2};
  ParameterDistribution distribution = ParameterDistribution::Prior(robot);
  CHECK(distribution.ToMessage().coordinate[1] == 2);
  for (const double sd : {.01, .5, 2.}) {
    distribution.mixture.components[0].mean[1] = .4;
    distribution.mixture.components[0].covariance(1, 1) = sd * sd;
    double mean = 0, square = 0, total = 0;
    constexpr int kCells = 200000;
    for (int i = 0; i < kCells; ++i) {
      const double y = (i + .5) / kCells, z = (std::log(y / (1 - y)) - .4) / sd;
      const double weight = std::exp(-z * z / 2) / (y * (1 - y)), p = .2 + y;
      total += weight, mean += weight * p, square += weight * p * p;
    }
    mean /= total;
    CHECK(distribution.Mean()[1] == Approx(mean).epsilon(1e-7));
    CHECK(distribution.Sd()[1] == Approx(std::sqrt(square / total - mean * mean)).epsilon(1e-5));
  }
  Random random(3);
  for (int i = 0; i < 1000; ++i) {
    const double p = distribution.Sample(random)[1];
    CHECK((p > .2 && p < 1.2));
  }
  const parameter_distribution_t message = distribution.ToMessage();
  CHECK(ParameterDistribution::FromMessage(message, robot).Mean()[1] == distribution.Mean()[1]);
  robot.parameters[1].coordinate = ParameterDescription::Coordinate::kLinear;
  CHECK_THROWS_WITH(ParameterDistribution::FromMessage(message, robot),
                    Catch::Contains("coordinate of 'friction'"));
}

TEST_CASE("A singular covariance is sampled on its subspace") {
  parameter_distribution_t message = ParameterDistribution::Prior(Robot()).ToMessage();
  message.covariance = {.04, .02, .02, .01};
  const ParameterDistribution distribution = ParameterDistribution::FromMessage(message, Robot());
  Random random(5);
  for (int i = 0; i < 20; ++i) {
    const Eigen::VectorXd offset =
        distribution.SampleCoordinates(random) - distribution.mixture.components[0].mean;
    CHECK(offset[0] == Approx(2 * offset[1]).margin(1e-7));
  }
}

TEST_CASE("A message survives the round trip bit by bit") {
  const parameter_distribution_t message = TwoComponents();
  const parameter_distribution_t again =
      ParameterDistribution::FromMessage(message, Robot()).ToMessage();
  CHECK(again.iteration == 3);
  CHECK(again.name == message.name);
  CHECK(again.coordinate == message.coordinate);
  CHECK(again.weight == message.weight);
  CHECK(again.mean == message.mean);
  CHECK(again.covariance == message.covariance);
  CHECK(again.explained == message.explained);
  CHECK(std::isnan(again.kl));
}

TEST_CASE("Whether its simulators explain the robot is told, and no residual beside it") {
  ParameterDistribution distribution = ParameterDistribution::Prior(Robot());
  CHECK_FALSE(ParameterDistribution::FromMessage(distribution.ToMessage(), Robot()).explained);
  distribution.explained = true;
  CHECK(ParameterDistribution::FromMessage(distribution.ToMessage(), Robot()).explained);
}

TEST_CASE("Hostile distributions are refused with a reason") {
  parameter_distribution_t message = TwoComponents();
  const auto refused_for = [&](const std::string& reason) {
    CHECK_THROWS_WITH(ParameterDistribution::FromMessage(message, Robot()),
                      Catch::Contains(reason));
  };
  ParameterDistribution::FromMessage(message, Robot());
  SECTION("name") { message.name[1] = "ofset", refused_for("'ofset', test robot has 'offset'"); }
  SECTION("coordinate") {
    message.coordinate[0] = parameter_distribution_t::LINEAR, refused_for("'gravity'");
  }
  SECTION("fewer parameters") {
    message.num_parameters = 1, refused_for("1 parameters, expected 2");
  }
  SECTION("shorter than announced") { message.name.pop_back(), refused_for("parameters"); }
  SECTION("no components") { message.num_components = 0, refused_for("0 components"); }
  SECTION("too many components") { message.num_components = 1 << 30, refused_for("components"); }
  SECTION("weights missing") { message.weight.pop_back(), refused_for("weights"); }
  SECTION("means") { message.num_means = 3, refused_for("means"); }
  SECTION("covariances") { message.covariance.push_back(0), refused_for("covariances"); }
  SECTION("iteration") { message.iteration = -1, refused_for("iteration -1"); }
  SECTION("NaN mean") { message.mean[2] = std::nan(""), refused_for("component 1"); }
  SECTION("infinite covariance") { message.covariance[0] = INFINITY, refused_for("component 0"); }
  SECTION("NaN weight") { message.weight[0] = std::nan(""), refused_for("component 0"); }
  SECTION("negative weight") { message.weight = {-1, 2}, refused_for("component 0"); }
  SECTION("weights") { message.weight[0] = .5, refused_for("sum to 1.25"); }
  SECTION("not symmetric") { message.covariance[5] = .005, refused_for("not symmetric"); }
  SECTION("not positive semidefinite") {
    message.covariance[5] = message.covariance[6] = .03, refused_for("not positive semidefinite");
  }
  SECTION("negative variance") {
    message.covariance[3] = -.01, refused_for("not positive semidefinite");
  }
  SECTION("a draw of a residual") {
    message.draw = {0, 150}, refused_for("the residual's draw of 'offset'");
  }
  SECTION("a start") {
    RobotDescription robot = Robot();
    robot.joints.resize(1);
    message.start = {0, 1e10f};
    CHECK_THROWS_WITH(ParameterDistribution::FromMessage(message, robot),
                      Catch::Contains("a start is beyond 1e+09"));
  }
  SECTION("overflow") { message.covariance[0] = 28, refused_for("'gravity' is"); }
  SECTION("a mean of e^150") { message.mean[0] = 150, refused_for("the mean of 'gravity'"); }
  SECTION("a variance of e^150") {
    message.covariance[3] = std::exp(150.), refused_for("the variance of 'offset'");
  }
  SECTION("far from the prior") {
    message.mean[1] = 101, refused_for("the mean of 'offset' is 1.01e+03");
  }
  SECTION("wide") {
    message.covariance[3] = 101, refused_for("the variance of 'offset' is 1.01e+04");
  }
}

}  // namespace
}  // namespace plumb
