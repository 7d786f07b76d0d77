#include "trainer/trainer.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "robot/parameter_distribution.h"
#include "tests/trainer/pendulum.h"
#include "trainer/checkpoint.h"

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
  const auto update = [](Trainer& t) {
    if (t.JudgementDue()) t.Judge(GymParameters);
    t.Update(GymParameters);
  };
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
  resumed.Restore(worse);
  CHECK(resumed.ReturnToBest(GymParameters) == 3);
  CHECK(resumed.policy().parameters == single.policy().parameters);

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
  void Reset(const SimulatorDraw&, Random& random) override {
    observation_ = static_cast<float>(random.Normal());
  }
  void Observe(Eigen::Ref<Eigen::VectorXf> observation) const override {
    observation[0] = observation_;
  }
  StepResult Step(const Eigen::Ref<const Eigen::VectorXf>&) override { return {-1, false}; }

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

TEST_CASE("returns scatter by where episodes begin") {
  CHECK(Scatter(std::vector<double>{4, NAN, 2, 3, 1, 0}) == Approx(std::sqrt(2.5)));
  CHECK(Scatter(std::vector<double>{7}) == 0);
  CHECK(Scatter(std::vector<double>{NAN}) == 0);

  // of u between 0.3 and 1, where they do not fall: 10 u scatters by 7 / sqrt 12
  const auto make = [] { return std::make_unique<StartDecides>(); };
  Trainer trainer(SmallSettings(), make, PendulumScale(), 5, 2);
  CHECK(trainer.ScatterOfStarts({Eigen::Vector3d(10, 1, 1)}) ==
        Approx(7 / std::sqrt(12)).epsilon(0.15));
}

TEST_CASE("Training returns to the best policy that was judged") {
  static double reward;  // of every step: policies are better or worse as we say
  class Told : public Endless {
   public:
    StepResult Step(const Eigen::Ref<const Eigen::VectorXf>&) override { return {reward, false}; }
  };
  TrainingSettings settings = SmallSettings();
  settings.updates = 32;  // a judgement before every second update
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
