#include "trainer/critic.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "tests/trainer/pendulum.h"

namespace plumb {
namespace {

struct Data {
  std::vector<float> observations;
  std::vector<double> targets;
};

/// Targets of returns' size: -500 + 300 sin(x) + 100 y.
Data SmoothTargets(uint64_t seed, double shift = 0) {
  Data data;
  Random random(seed);
  for (int i = 0; i < 2000; ++i) {
    const double x = random.Uniform(-2, 2), y = random.Uniform(-1, 1);
    data.observations.insert(data.observations.end(),
                             {static_cast<float>(x), static_cast<float>(y)});
    data.targets.push_back(shift - 500 + 300 * std::sin(x) + 100 * y);
  }
  return data;
}

TEST_CASE("Running moments are mean and deviation") {
  RunningMoments moments;
  CHECK(moments.sd() == 1);
  for (const double x : {1., 2., 3., 6.}) moments.Add(x);
  CHECK(moments.mean == Approx(3));
  CHECK(moments.sd() == Approx(std::sqrt(3.5)));
}

TEST_CASE("The critic learns targets of any size") {
  for (const double shift : {0., 1e6}) {
    Workers workers(1);
    Critic critic(PendulumSettings(), 2, Random(1), workers);
    Random random(2);
    const Data data = SmoothTargets(3, shift);
    for (int i = 0; i < 4; ++i) REQUIRE(critic.Fit(data.observations, data.targets, random));
    const Data fresh = SmoothTargets(4, shift);
    CHECK(ExplainedVariance(critic.Values(fresh.observations), fresh.targets) > .9);
  }
}

TEST_CASE("New targets move the normalisation, not the values") {
  TrainingSettings settings = PendulumSettings();
  Workers workers(1);
  Critic critic(settings, 2, Random(1), workers);
  Random random(2);
  const Data data = SmoothTargets(3);
  critic.Fit(data.observations, data.targets, random);
  const std::vector<double> before = critic.Values(data.observations);
  const RunningMoments moments = critic.state().targets;

  settings.critic_epochs = 0;  // normalise only
  Critic same(settings, 2, Random(1), workers);
  same.Restore(critic.state());
  std::vector<double> other = data.targets;
  for (double& target : other) target = 5 * target + 1000;
  same.Fit(data.observations, other, random);
  CHECK(same.state().targets.sd() > 1.5 * moments.sd());
  const std::vector<double> after = same.Values(data.observations);
  for (size_t i = 0; i < before.size(); ++i) REQUIRE(after[i] == Approx(before[i]).margin(.01));
}

TEST_CASE("A fit that is not finite is undone") {
  Workers workers(1);
  Critic critic(PendulumSettings(), 2, Random(1), workers);
  Random random(2);
  Data data = SmoothTargets(3);
  critic.Fit(data.observations, data.targets, random);
  const CriticState before = critic.state();
  data.targets[100] = std::numeric_limits<double>::infinity();
  CHECK_FALSE(critic.Fit(data.observations, data.targets, random));
  CHECK(critic.state().parameters == before.parameters);
  CHECK(critic.state().second_moment == before.second_moment);
  CHECK(critic.state().adam_steps == before.adam_steps);
  CHECK(critic.state().targets == before.targets);
}

TEST_CASE("Another network's state is refused") {
  Workers workers(1);
  Critic two(PendulumSettings(), 2, Random(1), workers),
      three(PendulumSettings(), 3, Random(1), workers);
  CHECK_THROWS_AS(two.Restore(three.state()), std::invalid_argument);
}

}  // namespace
}  // namespace plumb
