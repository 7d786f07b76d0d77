#include "trainer/session.h"

#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <vector>

#include "sim/residual_inputs.h"
#include "tests/temporary_folder.h"
#include "tests/trainer/pendulum.h"

namespace plumb {
namespace {

RobotDescription Robot() {
  RobotDescription robot;
  robot.name = "test robot";
  const auto log = ParameterDescription::Coordinate::kLog;
  robot.parameters = {{"gravity", "m/s^2", log, 10, .3},
                      {"mass/pole", "kg", log, 1, .03},
                      {"length/pole", "m", log, 1, .03}};
  robot.joints.resize(1);
  robot.joints[0].effort_limit = 2;
  robot.task.name = "pendulum";
  robot.task.steps = 200;
  robot.training = PendulumSettings();
  robot.training.batch = 800;
  robot.training.hidden = {12, 10};
  robot.training.updates = 6;
  robot.training.updates_again = 2;
  return robot;
}

ParameterDistribution Distribution(int iteration) {
  ParameterDistribution distribution = ParameterDistribution::Prior(Robot());
  distribution.iteration = iteration;
  return distribution;
}

// Of a model that does not explain the robot.
ParameterDistribution Lacking(int iteration) {
  ResidualFunction function;
  const int inputs = ResidualInputCount(Robot());
  function.mean = function.low = function.high = Eigen::VectorXd::Zero(inputs);
  function.scale = Eigen::VectorXd::Ones(inputs);
  function.centres = Eigen::MatrixXd::Zero(1, inputs);
  function.noise = Eigen::MatrixXd::Zero(2, 2);
  function.weights = {Eigen::MatrixXd::Zero(2, function.features())};
  function.bound = Eigen::VectorXd::Ones(2);
  function.unknown = Eigen::VectorXd::Zero(2);
  ParameterDistribution distribution = Distribution(iteration);
  Residual residual;
  residual.coordinates = {distribution.mixture.components[0].mean};
  residual.free = function;
  distribution.residual = std::make_shared<const Residual>(residual);
  return distribution;
}

TrainingSession NewSession(uint64_t seed = 4, int iterations = 2) {
  return TrainingSession(Robot(), MakeGymPendulum, iterations, seed, 1);
}

// CONTROLLER_STATUS at the end of a policy's roll-out: a trial of 100 steps that all pay the same,
// and exploration.
controller_status_t Tried(int iteration, double rate) {
  controller_status_t status{};
  status.policy_iteration = iteration;
  status.phase = controller_status_t::COMPLETE;
  status.purpose = policy_t::CALIBRATE;
  status.num_episodes = status.episodes_wanted = 2;
  status.episode = status.first_state_sequence = status.last_state_sequence = {1, 2};
  status.returns = {100 * rate, -1000};
  status.steps = {100, 100};
  status.late_rate = {rate, -10};
  status.fell = {0, 0};
  return status;
}

// In a folder that is still to be made.
std::string CheckpointIn(const TemporaryFolder& folder) {
  return folder / "sub/trainer.checkpoint";
}

void TrainToTheEnd(TrainingSession& session) {
  for (int update = 0; session.training(); ++update) {
    REQUIRE(update < 100);
    session.Advance();
  }
}

std::string ReadAll(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void WriteAll(const std::string& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
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

TEST_CASE("A run that is interrupted and resumed ends in the same bits") {
  const TemporaryFolder folder;
  TrainingSession straight = NewSession(), first = NewSession();
  straight.Begin(Distribution(0));
  TrainToTheEnd(straight);
  first.Begin(Distribution(0));
  for (int i = 0; i < 3; ++i) first.Advance();
  SaveCheckpoint(CheckpointIn(folder), first.MakeCheckpoint());

  TrainingSession second = NewSession();
  second.Restore(LoadCheckpoint(CheckpointIn(folder)).value());
  CHECK(second.training());
  CHECK(second.update() == 3);
  TrainToTheEnd(second);
  CHECK(second.Policy(1).weight == straight.Policy(1).weight);
  CHECK(second.evaluation().worst == straight.evaluation().worst);

  // And once more, between iterations: the policy is there to be sent again, the next distribution
  // is awaited.
  SaveCheckpoint(CheckpointIn(folder), second.MakeCheckpoint());
  TrainingSession third = NewSession();
  third.Restore(LoadCheckpoint(CheckpointIn(folder)).value());
  CHECK(third.complete());
  CHECK(third.awaited() == 1);
  CHECK(third.Policy(1).weight == straight.Policy(1).weight);
  CHECK(third.Status().evaluation_tenth == straight.Status().evaluation_tenth);
  for (TrainingSession* session : {&third, &straight}) {
    REQUIRE(session->AddTrial(Tried(0, -1)));
    REQUIRE(session->Begin(Distribution(1)));
    TrainToTheEnd(*session);
  }
  CHECK(third.Policy(1).weight == straight.Policy(1).weight);
  CHECK(third.MakeCheckpoint().critic.second_moment ==
        straight.MakeCheckpoint().critic.second_moment);
}

// The whole run of a session: what the trials pay, and whether the model explains the robot.
// @return the policies, by iteration.
std::vector<policy_t> RunAll(TrainingSession& session, const std::vector<double>& rates,
                             ParameterDistribution (*of)(int)) {
  std::vector<policy_t> policies;
  for (int iteration = 0; iteration <= static_cast<int>(rates.size()); ++iteration) {
    REQUIRE(session.Begin(of(iteration)));
    TrainToTheEnd(session);
    policies.push_back(session.Policy(1));
    if (!session.finished())
      REQUIRE(session.AddTrial(Tried(iteration, rates[static_cast<size_t>(iteration)])));
  }
  return policies;
}

TEST_CASE("Where the model is wrong, what does best on the robot is what it is run with") {
  TrainingSession session = NewSession(4, 3);
  SECTION("the first one") {
    const auto policies = RunAll(session, {-1, -3, -2}, Lacking);
    CHECK(policies[3].weight == policies[0].weight);
    CHECK(policies[3].iteration == 3);
    CHECK(policies[3].trained_in == 0);
    CHECK(policies[3].purpose == policy_t::EVALUATE);
    const training_status_t status = session.Status();
    CHECK(status.incumbent == 0);
    CHECK(status.incumbent_since == 0);
    CHECK(status.challenger == 2);
    CHECK(status.decision.find("policy 2 not accepted (-400") == 0);
    CHECK(status.probability < 0.01);
    CHECK(status.challenger_return == Approx(-400).epsilon(0.01));
    CHECK(status.incumbent_return == Approx(-200).epsilon(0.01));
  }
  SECTION("a later one") {
    const auto policies = RunAll(session, {-2, -1, -1.5}, Lacking);
    CHECK(policies[3].weight == policies[1].weight);
    CHECK(policies[3].trained_in == 1);
    CHECK(session.incumbent() == 1);
    CHECK(session.incumbent_since() == 2);  // when the next distribution was there
  }
  // Training goes on from the newest nevertheless.
  CHECK(session.MakeCheckpoint().policy.weight != session.Policy(1).weight);
  CHECK(DeployedPolicy(session.MakeCheckpoint()).weight == session.Policy(1).weight);
}

TEST_CASE("Where the model explains the robot the newest policy is trusted") {
  TrainingSession session = NewSession(4, 2);
  const auto policies = RunAll(session, {-1, -3}, Distribution);
  CHECK(policies[2].trained_in == 2);
  CHECK(policies[2].weight == session.MakeCheckpoint().policy.weight);
  const training_status_t status = session.Status();
  CHECK(status.incumbent == 2);
  CHECK(status.incumbent_since == 2);
  CHECK(status.challenger == 2);
  CHECK(status.decision.find("policy 2 trusted") == 0);
  CHECK(std::isnan(status.probability));  // it has not been tried
}

TEST_CASE("Without trials the newest policy is run") {
  RobotDescription robot = Robot();
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

TEST_CASE("Trials, the incumbent and the reason survive an interruption") {
  const TemporaryFolder folder;
  TrainingSession straight = NewSession(4, 3);
  const auto policies = RunAll(straight, {-2, -1, -1.02}, Lacking);
  // Interrupted after every roll-out and in the middle of every training.
  const auto anew = [] {
    return std::make_unique<TrainingSession>(Robot(), MakeGymPendulum, 3, 4, 1);
  };
  auto session = anew();
  const auto resume = [&] {
    SaveCheckpoint(CheckpointIn(folder), session->MakeCheckpoint());
    session = anew();
    session->Restore(LoadCheckpoint(CheckpointIn(folder)).value());
  };
  const std::vector<double> rates{-2, -1, -1.02};
  for (int iteration = 0; iteration <= 3; ++iteration) {
    REQUIRE(session->Begin(Lacking(iteration)));
    session->Advance();
    resume();
    TrainToTheEnd(*session);
    resume();
    if (iteration < 3)
      REQUIRE(session->AddTrial(Tried(iteration, rates[static_cast<size_t>(iteration)])));
    resume();
  }
  CHECK(session->Policy(1).weight == policies[3].weight);
  CHECK(session->Policy(1).trained_in == 1);
  CHECK(session->incumbent_since() == 2);
  const training_status_t status = session->Status(), expected = straight.Status();
  CHECK(status.decision == expected.decision);
  CHECK(status.probability == expected.probability);
  CHECK(status.challenger_return == expected.challenger_return);
  CHECK(EncodeCheckpoint(session->MakeCheckpoint()) == EncodeCheckpoint(straight.MakeCheckpoint()));
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
  CHECK(session.update() == 1);
  CHECK(session.Policy(1).weight == undisturbed.Policy(1).weight);
  for (TrainingSession* s : {&session, &undisturbed}) s->Advance();
  CHECK(session.Policy(1).weight != undisturbed.Policy(1).weight);
  CHECK(session.MakeCheckpoint().distribution.mean[0] == newer.mixture.components[0].mean[0]);
  TrainToTheEnd(session);
  CHECK_FALSE(session.Replace(Distribution(0)));  // its policy is out
}

TEST_CASE("No checkpoint is nothing; one of another run is an error") {
  const TemporaryFolder folder;
  CHECK_FALSE(LoadCheckpoint(CheckpointIn(folder)));
  TrainingSession session = NewSession();
  session.Begin(Distribution(0));
  const Checkpoint checkpoint = session.MakeCheckpoint();
  TrainingSession other_seed = NewSession(5);
  CHECK_THROWS_WITH(other_seed.Restore(checkpoint), Catch::Contains("seed 4, not 5"));
  RobotDescription robot = Robot();
  robot.training.hidden = {12};
  TrainingSession other_network(robot, MakeGymPendulum, 2, 4, 1);
  CHECK_THROWS_WITH(other_network.Restore(checkpoint), Catch::Contains("another robot or network"));
  robot = Robot();
  robot.parameters[0].name = "wind";
  TrainingSession other_robot(robot, MakeGymPendulum, 2, 4, 1);
  CHECK_THROWS_WITH(other_robot.Restore(checkpoint), Catch::Contains("another robot or network"));
}

TEST_CASE("What is not a regular file is no checkpoint, and is named") {
  const TemporaryFolder folder;
  const std::string pipe = folder / "pipe";
  REQUIRE(mkfifo(pipe.c_str(), 0600) == 0);
  CHECK_THROWS_WITH(LoadCheckpoint(pipe), Catch::Contains(pipe + " is not a regular file"));
  CHECK_THROWS_WITH(LoadCheckpoint("/tmp"), Catch::Contains("/tmp is not a regular file"));
}

TEST_CASE("A damaged checkpoint is refused, wherever the damage") {
  const TemporaryFolder folder;
  TrainingSession session = NewSession();
  session.Begin(Distribution(0));
  SaveCheckpoint(CheckpointIn(folder), session.MakeCheckpoint());
  const std::string good = ReadAll(CheckpointIn(folder));
  REQUIRE(LoadCheckpoint(CheckpointIn(folder)));
  CHECK_FALSE(std::filesystem::exists(CheckpointIn(folder) + ".new"));
  for (size_t at = 0; at < good.size(); at += 1 + at / 7) {
    std::string bad = good;
    bad[at] = static_cast<char>(bad[at] ^ 0x10);
    WriteAll(CheckpointIn(folder), bad);
    REQUIRE_THROWS_AS(LoadCheckpoint(CheckpointIn(folder)), CheckpointError);
    WriteAll(CheckpointIn(folder), good.substr(0, at));
    REQUIRE_THROWS_AS(LoadCheckpoint(CheckpointIn(folder)), CheckpointError);
  }
  WriteAll(CheckpointIn(folder), good + "x");
  CHECK_THROWS_AS(LoadCheckpoint(CheckpointIn(folder)), CheckpointError);
}

TEST_CASE("A checkpoint that cannot be written says why and leaves the old one") {
  const TemporaryFolder folder;
  TrainingSession session = NewSession();
  session.Begin(Distribution(0));
  WriteAll(folder / "sub", "a file where the folder should be");
  CHECK_THROWS_WITH(SaveCheckpoint(CheckpointIn(folder), session.MakeCheckpoint()),
                    Catch::Contains("Not a directory"));
}

}  // namespace
}  // namespace plumb
