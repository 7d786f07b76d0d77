#include "trainer/session.h"

#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

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

TrainingSession NewSession(uint64_t seed = 4) {
  return TrainingSession(Robot(), MakeGymPendulum, 2, seed, 1);
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
    CHECK(policy.episodes == (iteration < 2 ? 1 : 10));
    CHECK(policy.action_scale == std::vector<float>{2});
    CHECK_NOTHROW(GaussianPolicy::FromMessage(policy));
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
    session->Begin(Distribution(1));
    TrainToTheEnd(*session);
  }
  CHECK(third.Policy(1).weight == straight.Policy(1).weight);
  CHECK(third.MakeCheckpoint().critic.second_moment ==
        straight.MakeCheckpoint().critic.second_moment);
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
