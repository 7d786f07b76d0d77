#include "trainer/trainer.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/trainer/small_training.h"

namespace plumb {
namespace {

TEST_CASE("Training is the same bits for any number of threads") {
  TrainerState first{GaussianPolicy({3, {20, 20}, 1}), {}};
  for (const int threads : {1, 2, 3}) {
    Trainer trainer(SmallSettings(), MakeGymPendulum, PendulumScale(), 5, threads);
    for (int i = 0; i < 4; ++i) trainer.Update(GymParameters);
    const TrainerState state = trainer.state();
    if (threads == 1) first = state;
    CHECK(state.policy.parameters == first.policy.parameters);
    CHECK(state.critic.parameters == first.critic.parameters);
    CHECK(state.steps == 4000);
    CHECK(trainer.Evaluate(GymParameters, 3).mean == trainer.Evaluate(GymParameters, 3).mean);
  }
}

TEST_CASE("Another seed is another run") {
  Trainer a(SmallSettings(), MakeGymPendulum, PendulumScale(), 5, 1),
      b(SmallSettings(), MakeGymPendulum, PendulumScale(), 6, 1);
  a.Update(GymParameters);
  b.Update(GymParameters);
  CHECK(a.policy().parameters != b.policy().parameters);
}

TEST_CASE("The pendulum is learnt") {
  TrainingSettings settings = PendulumSettings();
  settings.hidden = {64, 64};
  Trainer trainer(settings, MakeGymPendulum, PendulumScale(), 1, 0);
  const double before = trainer.Evaluate(GymParameters, 20).mean;
  for (int i = 0; i < 45; ++i) {
    const UpdateReport report = trainer.Update(GymParameters);
    if (report.step.accepted) REQUIRE(report.step.kl <= settings.kl);
    REQUIRE(std::isfinite(report.explained_variance));
  }
  const double after = trainer.Evaluate(GymParameters, 20).mean;
  CHECK(before < -900);
  CHECK(after > -350);  // -150 is the best there is
  CHECK(trainer.policy().parameters.allFinite());
}

TEST_CASE("Time limits bootstrap: the value is that of a life without them") {
  TrainingSettings settings = SmallSettings();
  settings.gamma = .9;
  settings.lambda = .9;
  settings.batch = 400;
  const auto make = [] { return std::make_unique<Endless>(); };
  Trainer trainer(settings, make, Eigen::VectorXd::Ones(1), 3, 1);
  for (int i = 0; i < 40; ++i) trainer.Update(GymParameters);
  Workers workers(1);
  Critic critic(settings, 1, Random(1), workers);
  critic.Restore(trainer.state().critic);
  // -1 / (1 - .9); were the limit terminal, the mean over an episode would be -6 and its last value
  // -1.
  CHECK(critic.Values(std::vector<float>{0})[0] == Approx(-10).margin(.5));
}

/// Sees a number about 1000 with a deviation of 5, and one that never changes.
class FarAway : public Endless {
 public:
  int observation_size() const override { return 2; }
  void Observe(Eigen::Ref<Eigen::VectorXf> observation) const override {
    Endless::Observe(observation.head(1));
    observation << 1000 + 5 * observation[0], 7;
  }
};

TEST_CASE("The normaliser follows the observations, between updates") {
  TrainingSettings settings = SmallSettings();
  settings.normalise_observations = true;
  settings.batch = 4000;
  const auto make = [] { return std::make_unique<FarAway>(); };
  Trainer trainer(settings, make, Eigen::VectorXd::Ones(1), 3, 2);
  CHECK(trainer.policy().observation_mean.isZero());
  for (int i = 0; i < 5; ++i) trainer.Update(GymParameters);
  CHECK(trainer.policy().observation_mean[0] == Approx(1000).margin(.6));
  CHECK(trainer.policy().observation_scale[0] == Approx(5).epsilon(.1));
  CHECK(trainer.policy().observation_mean[1] == Approx(7));
  CHECK(trainer.policy().observation_scale[1] == 1);  // nothing to divide by
  // And a trainer restored goes on in the same bits.
  Trainer other(settings, make, Eigen::VectorXd::Ones(1), 3, 1);
  other.Restore(trainer.state());
  for (Trainer* t : {&trainer, &other}) t->Update(GymParameters);
  CHECK(other.policy().parameters == trainer.policy().parameters);
  CHECK(other.policy().observation_scale == trainer.policy().observation_scale);
}

TEST_CASE("A policy to begin with keeps its normaliser as if a whole training had made it") {
  TrainingSettings settings = SmallSettings();
  settings.normalise_observations = true;
  const auto make = [] { return std::make_unique<FarAway>(); };
  Trainer trainer(settings, make, Eigen::VectorXd::Ones(1), 3, 1);
  GaussianPolicy policy = trainer.policy();
  policy.observation_mean << 900, 7;
  policy.observation_scale << 5, 1;
  trainer.Start(policy);
  const double before = static_cast<double>(settings.updates) * settings.batch;
  const double seen = trainer.Update(GymParameters).batch;
  CHECK(trainer.policy().observation_mean[0] ==
        Approx((before * 900 + seen * 1000) / (before + seen)).margin(.2));
}

TEST_CASE("Learning from the worst episodes makes the worst simulators better") {
  // Half of the simulators pay 2 + 2 a, the others -a: on average a = 1 is best, in the worst case
  // a = -2/3.
  class Dilemma : public Endless {
   public:
    void Reset(const SimulatorDraw& simulator, Random& random) override {
      Endless::Reset(simulator, random);
      rich_ = simulator.parameters[0] > .5;
    }
    void Observe(Eigen::Ref<Eigen::VectorXf> observation) const override { observation[0] = 1; }
    StepResult Step(const Eigen::Ref<const Eigen::VectorXf>& action) override {
      const double a = std::clamp(double{action[0]}, -1., 1.);
      return {rich_ ? 2 + 2 * a : -a, false};
    }

   private:
    bool rich_ = false;
  };
  const ParameterSampler coin = [](Random& random) -> Eigen::VectorXd {
    return Eigen::VectorXd::Constant(1, random.Uniform());
  };
  double action[2];
  for (const int worst : {0, 1}) {
    TrainingSettings settings = SmallSettings();
    settings.batch = 800;
    settings.worst_share = worst ? .4 : 1;
    settings.worst_after = 0;
    Trainer trainer(
        settings, [] { return std::make_unique<Dilemma>(); }, Eigen::VectorXd::Ones(1), 3, 1);
    for (int i = 0; i < 40; ++i) trainer.Update(coin);
    action[worst] = trainer.policy().Mean(Eigen::VectorXf::Ones(1))[0];
    if (worst) CHECK(trainer.steps() > 40 * 800 / .5);  // what was thrown away was simulated, too
  }
  CHECK(action[0] > .5);
  CHECK(action[1] < -.2);
}

TEST_CASE("Rewards and states beyond all bounds never make weights that are no numbers") {
  class Wild : public Endless {
   public:
    void Reset(const SimulatorDraw& simulator, Random& random) override {
      Endless::Reset(simulator, random);
      kind_ = static_cast<int>(random.Uniform(0, 5));
    }
    void Observe(Eigen::Ref<Eigen::VectorXf> observation) const override {
      Endless::Observe(observation);
      if (kind_ == 1) observation[0] *= 1e30f;
    }
    StepResult Step(const Eigen::Ref<const Eigen::VectorXf>&) override {
      return {kind_ == 2 ? 1e300 : kind_ == 3 ? -1e200 : kind_ == 4 ? NAN : 1, false};
    }

   private:
    int kind_ = 0;
  };
  TrainingSettings settings = SmallSettings();
  settings.normalise_observations = true;
  Trainer trainer(
      settings, [] { return std::make_unique<Wild>(); }, Eigen::VectorXd::Ones(1), 3, 1);
  for (int i = 0; i < 10; ++i) {
    trainer.Update(GymParameters);
    REQUIRE(trainer.policy().parameters.allFinite());
    REQUIRE(trainer.policy().observation_mean.allFinite());
    REQUIRE((trainer.policy().observation_scale.array() > 0).all());
    REQUIRE(trainer.policy().observation_scale.allFinite());
    REQUIRE(trainer.state().critic.parameters.allFinite());
  }
}

}  // namespace
}  // namespace plumb
