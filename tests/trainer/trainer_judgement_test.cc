// Which policy a training goes on with, and what policies are judged by.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "robot/parameter_distribution.h"
#include "tests/trainer/small_training.h"
#include "trainer/checkpoint.h"

namespace plumb {
namespace {

TEST_CASE("Of several starts none learns from another, and the best policy goes on") {
  TrainingSettings settings = SmallSettings();
  settings.updates = 3, settings.starts = 2;
  settings.normalise_observations = true;
  const auto make = [](const TrainingSettings& of) {
    return Trainer(of, MakeGymPendulum, PendulumScale(), 5, 1);
  };
  Trainer trainer = make(settings), resumed = make(settings);
  settings.starts = 1;
  Trainer single = make(settings);
  const auto update = [](Trainer& t) { t.UpdateJudged(GymParameters); };
  for (int i = 0; i < 3; ++i) update(trainer), update(single);
  CHECK(trainer.policy().parameters == single.policy().parameters);
  CHECK(trainer.state().critic.parameters == single.state().critic.parameters);

  const double seen = single.state().observations.count / 3;  // by an update
  resumed.Restore(trainer.state());
  for (int i = 0; i < 3; ++i) {
    update(trainer), update(resumed);
    CHECK(trainer.state().observations.count == (i + 1) * seen);
  }
  CHECK(resumed.policy().parameters == trainer.policy().parameters);
  // As far from where both begin as three steps lead, and not as six do.
  CHECK(trainer.state().critic.adam_steps == single.state().critic.adam_steps);

  // The first start's policies count, too.
  TrainerState worse = trainer.state();
  worse.best->mean_return = 0, worse.best->updates = 3, worse.best->policy = single.policy();
  worse.best->observations = single.state().observations;
  resumed.Restore(worse);
  CHECK(resumed.ReturnToBest(GymParameters) == 3);
  CHECK(resumed.policy().parameters == single.policy().parameters);
  // Its normaliser follows what it has seen itself, not what the second start has.
  CHECK(resumed.state().observations.mean == single.state().observations.mean);

  // After them it goes on.
  update(trainer);
  CHECK(trainer.state().observations.count == 4 * seen);
  // A policy that it is given is its only start.
  settings.starts = 2;
  Trainer given = make(settings);
  given.Start(single.policy());
  for (int i = 0; i < 4; ++i) update(given);
  CHECK((given.policy().parameters - single.policy().parameters).norm() <
        (given.policy().parameters - make(settings).policy().parameters).norm());
  // Where nothing is judged, the last start would go on, however bad.
  CHECK(PaperSettings(settings).first_updates() == settings.updates);
}

/// Begins with u anywhere in [0, 1), which is the reward of each of ten steps; falls at once if it
/// is below 0.3.
class StartDecides : public GymPendulum {
 public:
  int steps_per_episode() const override { return 10; }
  void Reset(const SimulatorDraw& simulator, Random& random) override {
    GymPendulum::Reset(simulator, random);
    start_ = random.Uniform();
  }
  StepResult Step(const Eigen::Ref<const Eigen::VectorXf>&) override {
    return {start_, start_ < 0.3};
  }

 private:
  double start_ = 0;
};

TEST_CASE("trials scatter by where episodes begin") {
  // of u between 0.3 and 1, where they do not fall: 10 u scatters by 7 / sqrt 12, with a mean of
  // 6.5, whether a trial is all of the ten steps or three
  const auto make = [] { return std::make_unique<StartDecides>(); };
  Trainer trainer(SmallSettings(), make, PendulumScale(), 5, 2);
  for (const int steps : {3, 10, 99}) {
    const std::vector<double> trials = trainer.TrialReturns({Eigen::Vector3d(10, 1, 1)}, steps);
    CHECK(trials.size() == 40);
    CHECK(std::ranges::count_if(trials, [](double x) { return std::isnan(x); }) > 3);
    CHECK(Evaluate(trials).mean == Approx(6.5).epsilon(0.15));
    CHECK(Scatter(trials) == Approx(7 / std::sqrt(12)).epsilon(0.15));
  }
}

TEST_CASE("Training returns to the best policy that was judged") {
  static double reward;  // of every step: policies are better or worse as we say
  class Told : public Endless {
   public:
    StepResult Step(const Eigen::Ref<const Eigen::VectorXf>&) override { return {reward, false}; }
  };
  TrainingSettings settings = SmallSettings();
  settings.updates = 32;  // a judgement before every second update
  settings.normalise_observations = true;
  const auto new_trainer = [&] {
    return Trainer(
        settings, [] { return std::make_unique<Told>(); }, Eigen::VectorXd::Ones(1), 3, 1);
  };
  Trainer trainer = new_trainer();
  const auto judge = [&](double value) {
    reward = value;
    trainer.Judge(GymParameters);
  };
  const auto update = [&] {
    reward = 1;
    trainer.Update(GymParameters);
  };
  CHECK(trainer.JudgementDue());
  judge(1);
  update();
  CHECK_FALSE(trainer.JudgementDue());
  update();
  CHECK(trainer.JudgementDue());
  judge(2);
  const TrainerState best = trainer.state();
  update();
  update();
  judge(1.5);
  update();
  reward = 1.9;
  SECTION("with its critic, and forgets what it was worth") {
    CHECK(trainer.policy().parameters != best.policy.parameters);
    CHECK(trainer.ReturnToBest(GymParameters) == 2);
    CHECK(trainer.policy().parameters == best.policy.parameters);
    CHECK(trainer.state().critic.parameters == best.critic.parameters);
    CHECK(trainer.state().critic.adam_steps == best.critic.adam_steps);
    CHECK(trainer.state().observations.count == best.observations.count);
    CHECK(trainer.state().observations.squares == best.observations.squares);
    CHECK(trainer.updates() == 5);
    CHECK_FALSE(trainer.state().best);
    CHECK(trainer.JudgementDue());
  }
  SECTION("after a checkpoint, too") {
    Checkpoint checkpoint;
    checkpoint.distribution = ParameterDistribution().ToMessage();
    SetTrainerState(trainer.state(), checkpoint);
    Trainer other = new_trainer();
    other.Restore(TrainerStateOf(DecodeCheckpoint(EncodeCheckpoint(checkpoint))));
    CHECK(other.ReturnToBest(GymParameters) == 2);
    CHECK(other.policy().parameters == best.policy.parameters);
    CHECK(other.state().critic.second_moment == best.critic.second_moment);
    CHECK(other.state().observations.mean == best.observations.mean);
  }
  SECTION("which is the latest, if that is better") {
    reward = 2.1;
    const Eigen::VectorXf latest = trainer.policy().parameters;
    CHECK(trainer.ReturnToBest(GymParameters) == 5);
    CHECK(trainer.policy().parameters == latest);
  }
  SECTION("but not by judgements that are void") {
    trainer.ForgetBest();
    CHECK(trainer.JudgementDue());
    CHECK(trainer.ReturnToBest(GymParameters) == 5);
  }
}

TEST_CASE("Held-out simulators stay the same while the policy changes") {
  Trainer a(SmallSettings(), MakeGymPendulum, PendulumScale(), 5, 1),
      b(SmallSettings(), MakeGymPendulum, PendulumScale(), 5, 2);
  std::vector<double> drawn_a, drawn_b;
  const auto remember = [](std::vector<double>& drawn) {
    return [&drawn](Random& random) -> Eigen::VectorXd {
      drawn.push_back(random.Uniform(9, 11));
      return Eigen::Vector3d(drawn.back(), 1, 1);
    };
  };
  a.EvaluateHeldOut(remember(drawn_a), 5);
  a.Update(GymParameters);
  drawn_a.clear();
  a.EvaluateHeldOut(remember(drawn_a), 5);
  Trainer(SmallSettings(), MakeGymPendulum, PendulumScale(), 5, 1)
      .EvaluateHeldOut(remember(drawn_b), 5);
  CHECK(drawn_a == drawn_b);
}

}  // namespace
}  // namespace plumb
