#include "plot/curves.h"

#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <regex>
#include <set>
#include <string>

namespace plumb {
namespace {

TEST_CASE("a confidence band is Student's") {
  // t(0.975; 4) = 2.776445 (any table); sd of 1 ... 5 is sqrt(2.5).
  const Band band = ConfidenceBand({1, 2, 3, 4, 5}, false);
  const double half = 2.776445 * std::sqrt(2.5 / 5);
  CHECK(band.middle == Approx(3));
  CHECK(band.low == Approx(3 - half).epsilon(1e-6));
  CHECK(band.high == Approx(3 + half).epsilon(1e-6));
}

TEST_CASE("a band of logarithms is that of the exponents") {
  const Band band = ConfidenceBand({1e-3, 1e-1}, true);
  CHECK(band.middle == Approx(1e-2));
  CHECK(band.low * band.high == Approx(1e-4));  // symmetric about 1e-2
  const Band linear = ConfidenceBand({-3, -1}, false);
  CHECK(std::log10(band.low) == Approx(linear.low));
}

TEST_CASE("one run has no band, none no mean") {
  const Band band = ConfidenceBand({7}, false);
  CHECK(band.middle == 7);
  CHECK(std::isnan(band.low));
  CHECK(std::isnan(ConfidenceBand({}, false).middle));
}

TEST_CASE("a drawing has a line for each curve, in its colour, and leaves out what is not finite") {
  const Curve first{"one & two", {1, 2, 3}, {1, NAN, 3}, {0, NAN, 2}, {2, NAN, 4}},
      second{"three", {1, 2}, {2, 2}, {NAN, NAN}, {NAN, NAN}};
  const std::string svg = DrawCurves("title", {{"left", "x", "y", false, {first, second}},
                                               {"right", "x", "y", true, {first, second}}});
  CHECK(svg.find("one &amp; two") != std::string::npos);
  CHECK(svg.find("line c1") != std::string::npos);
  CHECK(svg.find("nan") == std::string::npos);
  CHECK(svg.find("inf") == std::string::npos);
}

TEST_CASE("however many curves there are, each has a colour, and the first twenty differ") {
  const std::vector<Curve> curves(24, {"one of many", {1, 2}, {1, 2}, {0, 1}, {2, 3}});
  const std::string svg = DrawCurves("title", {{"all", "x", "y", false, curves}});
  const std::regex drawn(R"re(class="((?:line|band) (c\d+)( again)?)")re");
  std::set<std::string> looks;
  int count = 0;
  for (std::sregex_iterator i(svg.begin(), svg.end(), drawn); i != std::sregex_iterator(); ++i) {
    const std::string kind = (*i)[1].str().substr(0, 4);
    CAPTURE(i->str());
    CHECK(svg.find(fmt::format(".{}.{} {{", kind, (*i)[2].str())) != std::string::npos);
    looks.insert((*i)[1]);
    ++count;
  }
  CHECK(count == 24 * 3);  // in the legend, too
  CHECK(looks.size() == 2 * 20);
  CHECK(svg.find(".line.again { stroke-dasharray") != std::string::npos);
}

}  // namespace
}  // namespace plumb
