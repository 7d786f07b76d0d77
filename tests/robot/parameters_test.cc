#include "robot/parameters.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

namespace plumb {
namespace {

using Catch::Contains;
using Coordinate = ParameterDescription::Coordinate;

const std::string kGravity = R"([[parameter]]
name = "gravity"
unit = "m/s^2"
coordinate = "log"
mean = 10.4
variance = 0.33
)";

struct Read {
  explicit Read(const std::string& text) {
    Config root = Config::Parse(text, "robot.toml");
    ReadParameters(root, parameters, frozen);
    root.Finish();
  }
  std::vector<ParameterDescription> parameters;
  std::vector<FrozenParameter> frozen;
};

std::string Logit(const std::string& mean, const std::string& variance, const std::string& bounds) {
  return "[[parameter]]\nname = \"delay\"\nunit = \"s\"\ncoordinate = \"logit\"\nmean = " + mean +
         "\nvariance = " + variance + "\n" + bounds;
}

ParameterDescription Bounded(double lower, double upper, double mean, double variance) {
  return {"p", "", Coordinate::kLogit, mean, variance, lower, upper};
}

TEST_CASE("a logit coordinate goes there and back") {
  for (const auto& p : {Bounded(0, 1, .3, .01), Bounded(-5, -4, -4.1, .01),
                        Bounded(0, .02, .004, 1e-6), Bounded(1e6, 1e6 + 1, 1e6 + .5, .01)}) {
    for (double x = -8; x <= 8; x += .25) {
      const double value = p.ToPhysical(x);
      CHECK(value > p.lower);
      CHECK(value < p.upper);
      // The distance to a bound is as exact as the value's own rounding allows.
      const double rounding = 4e-16 * std::abs(value) / std::min(value - p.lower, p.upper - value);
      CHECK(p.ToCoordinate(value) == Approx(x).margin(1e-12 + 4 * rounding));
    }
    CHECK(p.ToPhysical(0) == Approx((p.lower + p.upper) / 2));
    CHECK(p.ToPhysical(p.coordinate_mean()) == Approx(p.mean).epsilon(1e-14));
  }
  const ParameterDescription unit = Bounded(0, 1, .3, .01);
  CHECK(unit.ToCoordinate(.75) == Approx(std::log(3)));
  CHECK(unit.ToPhysical(-700) == Approx(std::exp(-700)));  // where 1 - 1 / (1 + e^x) is nothing
}

TEST_CASE("the bounds themselves are finite coordinates, and nothing leads to them") {
  const double infinity = std::numeric_limits<double>::infinity();
  for (const auto& p :
       {Bounded(0, 1, .3, .01), Bounded(-5, -4, -4.1, .01), Bounded(-1e12, 1e12, 0, 1)}) {
    for (const double x : {-infinity, -1e300, -1000., 1000., 1e300, infinity}) {
      const double value = p.ToPhysical(x);
      CHECK((value > p.lower && value < p.upper));
      CHECK(std::isfinite(p.ToCoordinate(value)));
    }
    for (const double value : {p.lower, p.upper, p.lower - 1, p.upper + 1}) {
      CHECK(std::isfinite(p.ToCoordinate(value)));
      CHECK((p.ToCoordinate(value) > 0) == (value >= p.upper));
    }
    CHECK(std::isnan(p.ToPhysical(std::nan(""))));
    CHECK(std::isnan(p.ToCoordinate(std::nan(""))));
    double last = -infinity;
    for (double x = -800; x <= 800; x += 7) {
      CHECK(p.ToPhysical(x) >= last);
      last = p.ToPhysical(x);
    }
  }
}

TEST_CASE(
    "a logit prior has its variance to first order: the derivative is that of finite differences") {
  for (const auto& p :
       {Bounded(0, 1, .3, .01), Bounded(-5, -4, -4.1, .002), Bounded(0, .02, .004, 1e-7)}) {
    const double h = 1e-6 * (p.upper - p.lower);
    const double derivative = (p.ToCoordinate(p.mean + h) - p.ToCoordinate(p.mean - h)) / (2 * h);
    CHECK(p.coordinate_variance() == Approx(p.variance * derivative * derivative).epsilon(1e-6));
    CHECK(p.coordinate_mean() == Approx(p.ToCoordinate(p.mean)));
  }
}

TEST_CASE("parameters are those to infer and those that are known") {
  const Read read(kGravity + Logit("0.004", "1e-6", "lower = 0.0\nupper = 0.02\n") +
                  "[[parameter]]\nname = \"mass/pole\"\nfrozen = true\nmean = 1.1\n");
  REQUIRE(read.parameters.size() == 2);
  CHECK(read.parameters[0].coordinate == Coordinate::kLog);
  CHECK(std::isinf(read.parameters[0].upper));
  CHECK(read.parameters[1].coordinate == Coordinate::kLogit);
  CHECK(read.parameters[1].upper == 0.02);
  REQUIRE(read.frozen.size() == 1);
  CHECK(read.frozen[0].name == "mass/pole");
  CHECK(read.frozen[0].value == 1.1);
}

TEST_CASE("mistakes in a parameter are at their lines") {
  const auto refused = [](const std::string& text, const std::string& what) {
    CHECK_THROWS_WITH(Read(text), Contains("robot.toml:") && Contains(what));
  };
  refused(Logit("0.5", "0.01", "lower = 0.0\n"), "upper is missing");
  refused(Logit("0.5", "0.01", "lower = 0.5\nupper = 1.0"),
          "7:9: parameter[0].lower must be below mean");
  refused(Logit("0.5", "0.01", "lower = 0.0\nupper = 0.5"),
          "8:9: parameter[0].upper must be above mean");
  refused(Logit("0.5", "0.25", "lower = 0.0\nupper = 1.0"),
          "6:12: parameter[0].variance = 0.25 is more than");
  refused(Logit("0.5", "0.01", "lower = nan\nupper = 1.0"), "7:9: parameter[0].lower");
  refused(kGravity + "lower = 1.0\n", "7:9: parameter[0].lower is for coordinate = \"logit\" only");
  refused(kGravity + "frozen = true\n",
          "4:14: parameter[0].coordinate has no effect on a frozen parameter");
  refused("[[parameter]]\nname = \"g\"\nfrozen = true\nmean = 1.0\n",
          "at least one [[parameter]] that is not frozen");
  refused("[[parameter]]\nname = \"g\"\nfrozen = true\nmean = inf\n", "4:8: parameter[0].mean");
  refused("[[parameter]]\nname = \"g\"\nfrozen = true\nmeen = 1.0\n",
          "meen is not a known key; did you mean mean?");
  refused(kGravity + "[[parameter]]\nname = \"gravity\"\nfrozen = true\nmean = 1.0\n",
          "8:8: parameter[1].name = \"gravity\" occurs twice");
  refused(
      "[[parameter]]\nname = \"g\"\nunit = \"\"\ncoordinate = \"linear\"\nmean = 1e300\nvariance = "
      "1.0\n",
      "5:8: parameter[0].mean");
}

}  // namespace
}  // namespace plumb
