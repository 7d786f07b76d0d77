#include "common/exponential.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

namespace plumb {

TEST_CASE("e to numbers that are not above zero is what it is") {
  std::vector<double> x;
  for (int i = 0; i <= 200'000; ++i) x.push_back(-690. * i / 200'000 - 1e-9 * i);
  std::vector<double> exp = x;
  ExpOfNegatives(exp);
  CHECK(exp[0] == 1);
  double worst = 0;
  for (size_t i = 0; i < x.size(); ++i)
    worst = std::max(worst, std::abs(exp[i] / std::exp(x[i]) - 1));
  CHECK(worst < 1e-12);
}

TEST_CASE("far below zero e to it is next to nothing, and its neighbours do not matter") {
  std::vector<double> ends{-1e9, -700, -INFINITY}, alone{-INFINITY};
  ExpOfNegatives(ends), ExpOfNegatives(alone);
  CHECK(ends[0] == ends[1]);
  CHECK((ends[2] == alone[0] && alone[0] < 1e-300));
}

}  // namespace plumb
