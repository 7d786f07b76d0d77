#include "plot/svg.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace plumb {
namespace {

TEST_CASE("ticks are round, few, and within their axis") {
  const auto labels = [](const Axis& axis, int count) {
    std::string all;
    for (const auto& tick : axis.Ticks(count)) all += tick.label + " ";
    return all;
  };
  CHECK(labels({0, 10, 0, 100}, 5) == "0 2 4 6 8 10 ");
  CHECK(labels({-0.31, 0.29, 0, 100}, 4) == "-0.2 0 0.2 ");
  CHECK(labels({9.801, 9.812, 0, 100}, 4) == "9.805 9.810 ");
  CHECK(labels({0.001, 1000, 0, 100, true}, 8) == "0.001 0.01 0.1 1 10 100 1000 ");
  CHECK(labels({1, 20, 0, 100, true}, 5) == "1 2 5 10 20 ");
  CHECK(Axis(1, 100, 0, 50, true).Pixel(10) == Approx(25));
  CHECK(Axis(3, 3, 0, 50).Pixel(3) == Approx(25));
  CHECK(std::isfinite(Axis(NAN, INFINITY, 0, 50).Pixel(0.5)));
}

TEST_CASE("a drawing for a file of its own is the page's with a style behind its title") {
  Svg svg(40, 30, "title");
  svg.Line(0, 0, 1, 1, "red");
  std::string alone = svg.PrintAlone(".red { stroke: #ff0000; }\n");
  const size_t begin = alone.find("<style>"), end = alone.find("</style>\n") + 9;
  CHECK(alone.substr(begin - 9, 9) == "</title>\n");
  CHECK(alone.substr(begin, end - begin).find(".red { stroke") != std::string::npos);
  CHECK(alone.erase(begin, end - begin) == svg.Print());
}

TEST_CASE("an ellipse is where the Mahalanobis distance is its sigma") {
  Eigen::Matrix2d covariance;
  covariance << 2, -0.7, -0.7, 0.5;
  const Eigen::Vector2d mean(3, -1);
  const auto points = Ellipse(mean, covariance, 2);
  REQUIRE(points.size() == 64);
  for (const auto& p : points)
    CHECK((p - mean).dot(covariance.inverse() * (p - mean)) == Approx(4));
  CHECK(Ellipse(mean, Eigen::Matrix2d::Constant(NAN), 1).empty());
}

}  // namespace
}  // namespace plumb
