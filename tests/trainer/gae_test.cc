#include "trainer/gae.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace plumb {
namespace {

constexpr double kGamma = .9, kLambda = .8;

TEST_CASE("Advantages are the sum of discounted differences, written out") {
  const std::vector<double> rewards = {1, -2, 3, .5}, values = {.3, .7, -.2, 1.1};
  const double final_value = 2;
  for (const bool terminated : {false, true}) {
    const std::vector<EpisodeSpan> episodes = {{0, 4, terminated}};
    const Advantages result =
        EstimateAdvantages(rewards, values, episodes, std::vector{final_value}, kGamma, kLambda);
    for (size_t t = 0; t < 4; ++t) {
      double expected = 0;
      for (size_t l = t; l < 4; ++l) {
        const double next = l < 3 ? values[l + 1] : terminated ? 0 : final_value;
        expected += std::pow(kGamma * kLambda, static_cast<double>(l - t)) *
                    (rewards[l] + kGamma * next - values[l]);
      }
      CHECK(result.advantage[t] == Approx(expected));
      CHECK(result.target[t] == Approx(expected + values[t]));
    }
  }
}

TEST_CASE("Where the values are right, the time limit leaves no trace") {
  // Reward 1 for ever is worth 1 / (1 - gamma) at every step, also at the last one before the
  // limit.
  const double value = 1 / (1 - kGamma);
  const std::vector<double> rewards(7, 1), values(7, value);
  const Advantages cut =
      EstimateAdvantages(rewards, values, std::vector<EpisodeSpan>{{0, 7, false}},
                         std::vector{value}, kGamma, kLambda);
  for (const double advantage : cut.advantage) CHECK(advantage == Approx(0).margin(1e-12));
  const Advantages ended = EstimateAdvantages(
      rewards, values, std::vector<EpisodeSpan>{{0, 7, true}}, std::vector{value}, kGamma, kLambda);
  CHECK(ended.advantage[6] == Approx(1 - value));
}

TEST_CASE("Nothing flows from one episode into another") {
  const std::vector<double> rewards = {1, 2, 3, 4}, values = {0, 0, 0, 0};
  const Advantages both =
      EstimateAdvantages(rewards, values, std::vector<EpisodeSpan>{{0, 2, false}, {2, 4, true}},
                         std::vector{5., 9.}, kGamma, kLambda);
  CHECK(both.advantage[1] == Approx(2 + kGamma * 5));
  CHECK(both.advantage[0] == Approx(1 + kGamma * kLambda * both.advantage[1]));
  CHECK(both.advantage[3] == Approx(4));
  CHECK(both.advantage[2] == Approx(3 + kGamma * kLambda * 4));
}

TEST_CASE("Normalised advantages have mean 0 and deviation 1; equal ones become zeros, not NaN") {
  std::vector<double> a = {1, 2, 3, 6};
  Normalize(a);
  double sum = 0, squares = 0;
  for (const double x : a) sum += x, squares += x * x;
  CHECK(sum == Approx(0).margin(1e-12));
  CHECK(squares / 4 == Approx(1));
  std::vector<double> equal(5, .1);
  Normalize(equal);
  CHECK(equal == std::vector<double>(5, 0));
}

}  // namespace
}  // namespace plumb
