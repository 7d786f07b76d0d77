#include "trainer/session.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "tests/temporary_folder.h"
#include "tests/trainer/pendulum_session.h"
#include "trainer/onnx_policy.h"
#include "trainer/policy_file.h"

namespace plumb {
namespace {

TEST_CASE("several starts are of the first iteration") {
  RobotDescription robot = PendulumRobot();
  robot.training.starts = 3;
  TrainingSession session(robot, MakeGymPendulum, 1, 4, 1);
  REQUIRE(session.Begin(Distribution(0)));
  CHECK(session.updates() == 18);
  TrainToTheEnd(session);
  CHECK(session.Status().update == 18);
  REQUIRE(session.AddTrial(Tried(0, -1)));
  REQUIRE(session.Begin(Distribution(1)));
  CHECK(session.updates() == 2);
}

TEST_CASE("Iterations follow one another, each for its own distribution") {
  TrainingSession session = NewSession();
  CHECK(session.awaited() == 0);
  CHECK_FALSE(session.Begin(Distribution(1)));
  CHECK_FALSE(session.training());
  for (int iteration = 0; iteration <= 2; ++iteration) {
    REQUIRE(session.awaited() == iteration);
    REQUIRE(session.Begin(Distribution(iteration)));
    CHECK_FALSE(session.Begin(Distribution(iteration)));  // a repeat
    CHECK(session.awaited() == -1);
    CHECK(std::isnan(session.Status().evaluation_return));
    int updates = 0;
    while (session.training()) {
      session.Advance();
      ++updates;
      REQUIRE(updates < 100);
      CHECK(session.Status().update == updates);
    }
    CHECK(updates == (iteration == 0 ? 6 : 2));
    CHECK(session.Status().complete);
    CHECK(std::isfinite(session.Status().evaluation_return));
    const policy_t policy = session.Policy(10);
    CHECK(policy.iteration == iteration);
    CHECK(policy.purpose == (iteration < 2 ? policy_t::CALIBRATE : policy_t::EVALUATE));
    CHECK(policy.episodes == (iteration < 2 ? 2 : 10));  // a trial and exploration
    CHECK(policy.trial_steps == (iteration < 2 ? 100 : 0));
    CHECK(policy.action_scale == std::vector<float>{2});
    CHECK_NOTHROW(GaussianPolicy::FromMessage(policy));
    CHECK(session.awaits_trial() == (iteration < 2));
    CHECK(session.AddTrial(Tried(iteration, -1)) == (iteration < 2));
  }
  CHECK(session.finished());
  CHECK(session.awaited() == -1);
  CHECK_FALSE(session.Begin(Distribution(3)));
  CHECK(session.Status().steps == 10 * 800);
}

TEST_CASE("Where the model is wrong, what does best on the robot is what it is run with") {
  TrainingSession session = NewSession(4, 3);
  SECTION("the first one") {
    // Further apart than where an episode begins can make two trials.
    const auto policies = RunAll(session, {-1000, -3000, -2000}, Lacking);
    CHECK(policies[3].weight == policies[0].weight);
    CHECK(policies[3].iteration == 3);
    CHECK(policies[3].trained_in == 0);
    CHECK(policies[3].purpose == policy_t::EVALUATE);
    const training_status_t status = session.Status();
    CHECK(status.incumbent == 0);
    CHECK(status.incumbent_since == 0);
    CHECK(status.challenger == 2);
    CHECK(status.decision.find("policy 2 not accepted (-4e+05") == 0);
    CHECK(status.probability < 0.01);
    CHECK(status.challenger_return == Approx(-4e5).epsilon(0.01));
    CHECK(status.incumbent_return == Approx(-2e5).epsilon(0.01));
  }
  SECTION("a later one") {
    const auto policies = RunAll(session, {-2000, -1000, -1500}, Lacking);
    CHECK(policies[3].weight == policies[1].weight);
    CHECK(policies[3].trained_in == 1);
    CHECK(session.incumbent() == 1);
    CHECK(session.incumbent_since() == 2);  // when the next distribution was there
  }
  // Training goes on from the newest nevertheless.
  CHECK(session.MakeCheckpoint().policy.weight != session.Policy(1).weight);
  CHECK(DeployedPolicy(session.MakeCheckpoint()).weight == session.Policy(1).weight);
}

TEST_CASE("Where beginnings decide, simulators outweigh a trial") {
  TrainingSession session = NewSession(4, 3);
  // 100 apart, as far as trials are that begin anywhere; in simulation the newest is better.
  const auto policies = RunAll(session, {-1, -3, -1.5}, Lacking);
  const training_status_t status = session.Status();
  CHECK(policies[3].trained_in == 2);
  CHECK(status.decision.find("policy 2 accepted (-300") == 0);
  CHECK(status.probability > 0.75);
  CHECK(status.probability < 0.98);  // at most Phi(2): simulators may be wrong by half
}

TEST_CASE("Where the model explains the robot the newest policy is trusted") {
  TrainingSession session = NewSession(4, 2);
  const auto policies = RunAll(session, {-1, -3}, Explaining);
  CHECK(policies[2].trained_in == 2);
  CHECK(policies[2].weight == session.MakeCheckpoint().policy.weight);
  const training_status_t status = session.Status();
  CHECK(status.incumbent == 2);
  CHECK(status.incumbent_since == 2);
  CHECK(status.challenger == 2);
  CHECK(status.decision.find("policy 2 trusted") == 0);
  CHECK(std::isnan(status.probability));  // it has not been tried
}

TEST_CASE("Where nobody could tell whether the model explains the robot, trials decide") {
  TrainingSession session = NewSession(4, 3);
  const auto policies = RunAll(session, {-1000, -3000, -2000}, Distribution);
  CHECK(policies[3].trained_in == 0);
  CHECK(session.Status().decision.find("policy 2 not accepted") == 0);
}

/// Of the prior a good third cannot be simulated.
class Breaking : public GymPendulum {
 public:
  void Reset(const SimulatorDraw& simulator, Random& random) override {
    GymPendulum::Reset(simulator, random);
    breaks_ = simulator.parameters[0] < 9.8;
  }
  StepResult Step(const Eigen::Ref<const Eigen::VectorXf>& action) override {
    const StepResult result = GymPendulum::Step(action);
    return breaks_ ? StepResult{NAN, false} : result;
  }

 private:
  bool breaks_ = false;
};

TEST_CASE("Episodes that are dropped are counted in the status") {
  TrainingSession session(
      PendulumRobot(), [] { return std::make_unique<Breaking>(); }, 1, 4, 1);
  REQUIRE(session.Begin(Distribution(0)));
  CHECK(session.Status().dropped_episodes == 0);
  int64_t dropped = 0;
  while (session.training()) {
    dropped += session.Advance().dropped_episodes;
    CHECK(session.Status().dropped_episodes == dropped);
  }
  CHECK(dropped > 3);
}

TEST_CASE("Without trials the newest policy is run") {
  RobotDescription robot = PendulumRobot();
  robot.training.trial = 0;
  TrainingSession session(robot, MakeGymPendulum, 1, 4, 1);
  CHECK(session.incumbent() == -1);
  session.Begin(Distribution(0));
  TrainToTheEnd(session);
  CHECK(session.Policy(9).episodes == 1);
  CHECK(session.Policy(9).trial_steps == 0);
  CHECK_FALSE(session.AddTrial(Tried(0, -1)));
  REQUIRE(session.Begin(Lacking(1)));
  CHECK(session.incumbent() == 0);
  TrainToTheEnd(session);
  CHECK(session.Policy(9).trained_in == 1);
  CHECK(session.Policy(9).weight == session.MakeCheckpoint().policy.weight);
  CHECK(session.incumbent() == 1);
  CHECK(session.Status().decision.empty());
}

TEST_CASE("No iteration begins before the policy of the last one has been tried") {
  TrainingSession session = NewSession();
  CHECK_FALSE(session.AddTrial(Tried(0, -1)));  // there is no policy
  session.Begin(Distribution(0));
  CHECK_FALSE(session.AddTrial(Tried(0, -1)));
  TrainToTheEnd(session);
  CHECK_FALSE(session.Begin(Distribution(1)));
  CHECK(session.awaited() == 1);
  const auto refused = [&](void (*spoil)(controller_status_t&)) {
    controller_status_t status = Tried(0, -1);
    spoil(status);
    CHECK_FALSE(session.AddTrial(status));
    CHECK(session.awaits_trial());
  };
  refused([](controller_status_t& s) { s.policy_iteration = 1; });
  refused([](controller_status_t& s) { s.phase = controller_status_t::RUNNING; });
  refused([](controller_status_t& s) { s.purpose = policy_t::EVALUATE; });
  refused([](controller_status_t& s) { s.num_episodes = 1; });
  refused([](controller_status_t& s) { s.steps.pop_back(); });
  refused([](controller_status_t& s) { s.returns.clear(); });
  refused([](controller_status_t& s) { s.late_rate.push_back(0); });
  refused([](controller_status_t& s) { s.fell.clear(); });
  refused([](controller_status_t& s) { s.returns[0] = NAN; });
  refused([](controller_status_t& s) { s.late_rate[0] = INFINITY; });
  refused([](controller_status_t& s) { s.steps[0] = -1; });
  refused([](controller_status_t& s) { s.steps[0] = 101; });
  CHECK(session.AddTrial(Tried(0, -1)));
  CHECK_FALSE(session.AddTrial(Tried(0, -7)));  // repeated ten times a second
  CHECK(session.Begin(Distribution(1)));
  CHECK(session.Status().challenger_return == Approx(-200).epsilon(0.01));
}

TEST_CASE("A newer distribution of the iteration takes effect at the next batch") {
  TrainingSession session = NewSession(), undisturbed = NewSession();
  ParameterDistribution newer = Distribution(0);
  CHECK_FALSE(session.Replace(newer));  // nothing has begun
  for (TrainingSession* s : {&session, &undisturbed}) {
    s->Begin(Distribution(0));
    s->Advance();
  }
  CHECK_FALSE(session.Replace(newer));  // a repeat
  newer.iteration = 1;
  newer.mixture.components[0].mean[0] += 1;
  CHECK_FALSE(session.Replace(newer));
  newer.iteration = 0;
  REQUIRE(session.Replace(newer));
  CHECK_FALSE(session.Replace(newer));
  CHECK(session.update() == 1);
  CHECK(session.Policy(1).weight == undisturbed.Policy(1).weight);
  for (TrainingSession* s : {&session, &undisturbed}) s->Advance();
  CHECK(session.Policy(1).weight != undisturbed.Policy(1).weight);
  CHECK(session.MakeCheckpoint().distribution.mean[0] == newer.mixture.components[0].mean[0]);
  TrainToTheEnd(session);
  CHECK_FALSE(session.Replace(Distribution(0)));  // its policy is out
}

TEST_CASE("A distribution that differs in its residual or in its starts alone is another") {
  TrainingSession session = NewSession();
  session.Begin(Distribution(0));
  CHECK(session.Replace(Lacking(0)));
  CHECK_FALSE(session.Replace(Lacking(0)));
  ParameterDistribution elsewhere = Lacking(0);
  elsewhere.starts = {Eigen::Vector2d(1, 0)};
  CHECK(session.Replace(elsewhere));
}

// Nothing that is sent may end the trainer.
TEST_CASE("a distribution that cannot be simulated is refused, and a good one begins after it") {
  TrainingSession session = NewSession();
  ParameterDistribution impossible = Distribution(0);
  impossible.mixture.components[0].mean[0] = 800;  // gravity and length are infinite
  impossible.mixture.components[0].mean[2] = 800;
  CHECK_THROWS_WITH(
      session.Begin(impossible),
      Catch::Equals("parameter distribution: of 20 simulators drawn from it 20 cannot be "
                    "simulated"));
  CHECK(session.awaited() == 0);
  REQUIRE(session.Begin(Distribution(0)));
  CHECK_THROWS(session.Replace(impossible));
  TrainToTheEnd(session);
  TrainingSession undisturbed = NewSession();
  REQUIRE(undisturbed.Begin(Distribution(0)));
  TrainToTheEnd(undisturbed);
  CHECK(session.Policy(1).weight == undisturbed.Policy(1).weight);
}

TEST_CASE("a policy that is too large to be sent is refused before it is trained") {
  RobotDescription robot = PendulumRobot();
  robot.training.hidden = {1000, 1000};
  CHECK_NOTHROW(RequireSendable(robot));
  robot.training.hidden = {1100, 1000};
  CHECK_THROWS_WITH(RequireSendable(robot), Catch::Contains("[training] hidden") &&
                                                Catch::Contains("4.2 MB") &&
                                                Catch::Contains("4 MB"));
  CHECK_THROWS(TrainingSession(robot, MakeGymPendulum, 1, 1, 1));
  robot.task.period = 0.05;
  const auto task = MakeTask(robot);
  GaussianPolicy policy({task->observation_size(), robot.training.hidden, task->action_size()});
  policy.action_scale = robot.effort_limits().cast<float>();
  const TemporaryFolder folder;
  const std::string file = folder / "large.onnx";
  WriteOnnxPolicy(file, {policy, MakePolicyRecord(robot, *task)});
  CHECK_NOTHROW(LoadPolicy(file, robot, *task));
  CHECK_THROWS_WITH(LoadSendablePolicy(file, robot),
                    Catch::Contains("large.onnx") && Catch::Contains("4.2 MB"));
}

}  // namespace
}  // namespace plumb
