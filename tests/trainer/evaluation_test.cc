#include "trainer/evaluation.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

namespace plumb {
namespace {

TEST_CASE("Returns are summed up by mean, tenth percentile and worst") {
  std::vector<double> returns;
  for (int i = 10; i >= 0; --i) returns.push_back(i * i);
  Evaluation evaluation = Evaluate(returns);
  CHECK(evaluation.mean == Approx(35));
  CHECK(evaluation.tenth == Approx(1));
  CHECK(evaluation.worst == 0);
  returns.push_back(NAN);
  evaluation = Evaluate(returns);
  CHECK(evaluation.mean == Approx(35));
  CHECK(evaluation.failed == 1);
  CHECK(evaluation.episodes == 12);
  CHECK(std::isnan(Evaluate(std::vector<double>{NAN}).worst));
  CHECK(Evaluate(std::vector<double>{3}).tenth == 3);
}

TEST_CASE("The mean of the worst returns") {
  const std::vector<double> returns{4, NAN, 1, 3, 2};
  CHECK(MeanOfWorst(returns, 1) == Approx(2.5));
  CHECK(MeanOfWorst(returns, .5) == Approx(1.5));
  CHECK(MeanOfWorst(returns, .3) == Approx(1.5));
  CHECK(MeanOfWorst(returns, .25) == Approx(1));
  CHECK(std::isnan(MeanOfWorst(std::vector<double>{NAN}, 1)));
}

TEST_CASE("The standard deviation of returns") {
  CHECK(Scatter(std::vector<double>{4, NAN, 2, 3, 1, 0}) == Approx(std::sqrt(2.5)));
  CHECK(Scatter(std::vector<double>{7}) == 0);
  CHECK(Scatter(std::vector<double>{NAN}) == 0);
}

}  // namespace
}  // namespace plumb
