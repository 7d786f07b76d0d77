#include "trainer/trainer.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/trainer/pendulum.h"

namespace plumb {
namespace {

TrainingSettings SmallSettings() {
  TrainingSettings settings = PendulumSettings();
  settings.batch = 1000;
  settings.hidden = {20, 20};
  return settings;
}

Eigen::VectorXd PendulumScale() { return Eigen::VectorXd::Constant(1, 2); }

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

/// One reward for ever; the time limit is all that ever happens.
class Endless : public Simulation {
 public:
  int observation_size() const override { return 1; }
  int action_size() const override { return 1; }
  int steps_per_episode() const override { return 20; }
  void Reset(const Eigen::VectorXd&, Random& random) override {
    observation_ = static_cast<float>(random.Normal());
  }
  void Observe(Eigen::Ref<Eigen::VectorXf> observation) const override { observation[0] = observation_; }
  Outcome Step(const Eigen::Ref<const Eigen::VectorXf>&) override { return {-1, false}; }

 private:
  float observation_ = 0;
};

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
  // -1 / (1 - .9); were the limit terminal, the mean over an episode would be -6 and its last value -1.
  CHECK(critic.Values(std::vector<float>{0})[0] == Approx(-10).margin(.5));
}

}  // namespace
}  // namespace plumb
