#include "trainer/rollout.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>

#include "tests/trainer/pendulum.h"

namespace plumb {
namespace {

const PolicyShape kShape{3, {16, 16}, 1};

GaussianPolicy SomePolicy() {
  GaussianPolicy policy(kShape);
  Random random(8);
  for (float& value : policy.parameters) value = static_cast<float>(.3 * random.Normal());
  policy.observation_mean << .1f, 0, -.2f;
  policy.observation_scale << 1, 2, 3;
  return policy;
}

Eigen::VectorXd RandomParameters(Random& random) {
  return Eigen::Vector3d(random.Uniform(9, 11), random.Uniform(.9, 1.1), random.Uniform(.9, 1.1));
}

/// Lasts 5 + 10 p steps (p the parameter, in [0, 1)) and then terminates, or breaks as told.
class Fragile : public Simulation {
 public:
  enum class Break { kNever, kReward, kObservation, kReset };
  explicit Fragile(Break kind) : break_(kind) {}
  int observation_size() const override { return 3; }
  int action_size() const override { return 1; }
  int steps_per_episode() const override { return 100; }
  void Reset(const SimulatorDraw& simulator, Random&) override {
    length_ = 5 + static_cast<int>(10 * simulator.parameters[0]);
    step_ = 0;
    fails_ = simulator.parameters[0] < .3;
    if (fails_ && break_ == Break::kReset) throw std::invalid_argument("no such simulator");
  }
  void Observe(Eigen::Ref<Eigen::VectorXf> observation) const override {
    observation.setConstant(static_cast<float>(step_));
    if (fails_ && break_ == Break::kObservation && step_ == 2) observation[1] = NAN;
  }
  StepResult Step(const Eigen::Ref<const Eigen::VectorXf>&) override {
    ++step_;
    return {fails_ && break_ == Break::kReward && step_ == 3 ? NAN : 1., step_ >= length_};
  }

 private:
  Break break_;
  bool fails_ = false;
  int length_ = 0, step_ = 0;
};

Eigen::VectorXd UniformParameter(Random& random) {
  return Eigen::VectorXd::Constant(1, random.Uniform());
}

TEST_CASE("A batch is the same bits for any number of threads") {
  Batch first;
  for (const int threads : {1, 2, 5}) {
    Workers workers(threads);
    RolloutSampler rollout(MakeGymPendulum, kShape, workers);
    const Batch batch = rollout.Collect(SomePolicy(), RandomParameters, 1500, 1, 7, 1, 2);
    CHECK(batch.size() == 1600);  // whole episodes of 200
    CHECK(batch.episodes.size() == 8);
    if (threads == 1) first = batch;
    CHECK(batch.observations == first.observations);
    CHECK(batch.actions == first.actions);
    CHECK(batch.rewards == first.rewards);
    CHECK(batch.final_observations == first.final_observations);
  }
}

TEST_CASE(
    "Replaying the actions of an episode gives its observations, rewards and last observation") {
  Workers workers(1);
  RolloutSampler rollout(MakeGymPendulum, kShape, workers);
  const GaussianPolicy policy = SomePolicy();
  const Batch batch = rollout.Collect(policy, RandomParameters, 600, 1, 7, 1, 2);
  double total = 0;
  for (int e = 0; e < 3; ++e) {
    Random random(7, {1, 2, static_cast<uint32_t>(e)});
    GymPendulum pendulum;
    const Eigen::VectorXd parameters = RandomParameters(random);
    pendulum.Reset(parameters, random);
    Eigen::VectorXf observation(3);
    double sum = 0;
    for (int i = 200 * e; i < 200 * (e + 1); ++i) {
      const auto at = static_cast<size_t>(i);
      pendulum.Observe(observation);
      REQUIRE(policy.Normalize(observation) ==
              Eigen::Map<const Eigen::Vector3f>(&batch.observations[3 * at]));
      const StepResult result = pendulum.Step(Eigen::VectorXf::Constant(1, batch.actions[at]));
      REQUIRE(result.reward == batch.rewards[at]);
      sum += result.reward;
    }
    pendulum.Observe(observation);
    const auto episode = static_cast<size_t>(e);
    CHECK(policy.Normalize(observation) ==
          Eigen::Map<const Eigen::Vector3f>(&batch.final_observations[3 * episode]));
    total += sum;
    CHECK_FALSE(batch.episodes[episode].terminated);  // the time limit is no termination
  }
  CHECK(batch.mean_return == Approx(total / 3));
}

TEST_CASE("Actions scatter about the policy's mean by its deviation") {
  Workers workers(1);
  RolloutSampler rollout(MakeGymPendulum, kShape, workers);
  GaussianPolicy policy = SomePolicy();
  policy.parameters.tail(1).setConstant(-.5f);
  policy.observation_mean.setZero();
  policy.observation_scale.setOnes();
  const Batch batch = rollout.Collect(policy, RandomParameters, 20000, 1, 7, 1, 2);
  double sum = 0, squares = 0;
  for (int i = 0; i < batch.size(); ++i) {
    const Eigen::Vector3f observation(&batch.observations[static_cast<size_t>(3 * i)]);
    const double offset = batch.actions[static_cast<size_t>(i)] - policy.Mean(observation)[0];
    sum += offset;
    squares += offset * offset;
  }
  CHECK(sum / batch.size() == Approx(0).margin(.02));
  CHECK(std::sqrt(squares / batch.size()) == Approx(std::exp(-.5)).epsilon(.03));
}

TEST_CASE(
    "Episodes that terminate early are followed by more, the same for any number of threads") {
  Batch first;
  for (const int threads : {1, 3}) {
    Workers workers(threads);
    RolloutSampler rollout([] { return std::make_unique<Fragile>(Fragile::Break::kNever); }, kShape,
                           workers);
    const Batch batch = rollout.Collect(SomePolicy(), UniformParameter, 300, 1, 7, 1, 2);
    CHECK(batch.size() >= 300);
    CHECK(batch.size() < 450);  // how many were needed had to be guessed from the first few
    for (const EpisodeSpan& episode : batch.episodes) {
      CHECK(episode.terminated);
      const auto begin = batch.rewards.begin();
      CHECK(std::accumulate(begin + episode.begin, begin + episode.end, 0.0) ==
            episode.end - episode.begin);
    }
    if (threads == 1) first = batch;
    CHECK(batch.observations == first.observations);
  }
}

TEST_CASE("What is not finite is dropped with its episode and counted") {
  for (const auto kind :
       {Fragile::Break::kReward, Fragile::Break::kObservation, Fragile::Break::kReset}) {
    Workers workers(2);
    RolloutSampler rollout([kind] { return std::make_unique<Fragile>(kind); }, kShape, workers);
    const Batch batch = rollout.Collect(SomePolicy(), UniformParameter, 1000, 1, 7, 1, 2);
    CHECK(batch.dropped > 10);
    CHECK(batch.size() >= 1000);
    for (const double reward : batch.rewards) REQUIRE(reward == 1);
    for (const float value : batch.observations) REQUIRE(std::isfinite(value));
    for (const EpisodeSpan& episode : batch.episodes) CHECK(episode.end - episode.begin >= 8);
  }
}

TEST_CASE("Where most simulations break the others are learned from") {
  Workers workers(2);
  RolloutSampler rollout([] { return std::make_unique<Fragile>(Fragile::Break::kReward); }, kShape,
                         workers);
  const ParameterSampler mostly = [](Random& random) -> Eigen::VectorXd {
    return Eigen::VectorXd::Constant(1, 0.5 * random.Uniform());  // three in five
  };
  for (uint32_t number = 0; number < 20; ++number) {
    const Batch batch = rollout.Collect(SomePolicy(), mostly, 150, 1, 7, 1, number);
    CHECK(batch.size() >= 150);
  }
}

TEST_CASE("A simulation that always breaks is an error, not an endless loop") {
  Workers workers(2);
  RolloutSampler rollout([] { return std::make_unique<Fragile>(Fragile::Break::kReward); }, kShape,
                         workers);
  const ParameterSampler broken = [](Random&) -> Eigen::VectorXd {
    return Eigen::VectorXd::Zero(1);
  };
  CHECK_THROWS_WITH(rollout.Collect(SomePolicy(), broken, 1000, 1, 7, 1, 2),
                    Catch::Contains("nothing to learn from"));
  for (const double sum : rollout.Returns(SomePolicy(), broken, 5, 7, 1, 2)) CHECK(std::isnan(sum));
}

TEST_CASE("A policy that has gone to NaN gives no batch") {
  Workers workers(1);
  RolloutSampler rollout(MakeGymPendulum, kShape, workers);
  GaussianPolicy policy = SomePolicy();
  policy.parameters[5] = NAN;
  CHECK_THROWS_AS(rollout.Collect(policy, RandomParameters, 3000, 1, 7, 1, 2), std::runtime_error);
}

}  // namespace
}  // namespace plumb
