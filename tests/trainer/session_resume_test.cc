// Sessions that are interrupted and resumed, and the checkpoints that carry them over.
#include <sys/stat.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "tests/temporary_folder.h"
#include "tests/trainer/pendulum_session.h"
#include "trainer/checkpoint.h"

namespace plumb {
namespace {

// In a folder that is still to be made.
std::string CheckpointIn(const TemporaryFolder& folder) {
  return folder / "sub/trainer.checkpoint";
}

std::string ReadAll(const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void WriteAll(const std::string& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

TEST_CASE("A run that is interrupted and resumed ends in the same bits") {
  const TemporaryFolder folder;
  TrainingSession straight = NewSession(), first = NewSession();
  straight.Begin(Distribution(0));
  TrainToTheEnd(straight);
  first.Begin(Distribution(0));
  for (int i = 0; i < 3; ++i) first.Advance();
  SaveCheckpoint(CheckpointIn(folder), first.MakeCheckpoint());
  CHECK_THROWS_WITH(LoadSendablePolicy(CheckpointIn(folder), PendulumRobot()),
                    Catch::Contains("its training has not ended, after 3 updates"));

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
  CHECK_NOTHROW(LoadSendablePolicy(CheckpointIn(folder), PendulumRobot()));
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

TEST_CASE("Trials, the incumbent and the reason survive an interruption") {
  const TemporaryFolder folder;
  TrainingSession straight = NewSession(4, 3);
  // So far apart that trials decide, wherever an episode begins.
  const std::vector<double> rates{-2000, -1000, -1020};
  const auto policies = RunAll(straight, rates, Lacking);
  // Interrupted after every roll-out and in the middle of every training.
  const auto anew = [] {
    return std::make_unique<TrainingSession>(PendulumRobot(), MakeGymPendulum, 3, 4, 1);
  };
  auto session = anew();
  const auto resume = [&] {
    SaveCheckpoint(CheckpointIn(folder), session->MakeCheckpoint());
    session = anew();
    session->Restore(LoadCheckpoint(CheckpointIn(folder)).value());
  };
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

TEST_CASE("No checkpoint is nothing; one of another run is an error") {
  const TemporaryFolder folder;
  CHECK_FALSE(LoadCheckpoint(CheckpointIn(folder)));
  TrainingSession session = NewSession();
  session.Begin(Distribution(0));
  const Checkpoint checkpoint = session.MakeCheckpoint();
  TrainingSession other_seed = NewSession(5);
  CHECK_THROWS_WITH(other_seed.Restore(checkpoint), Catch::Contains("seed 4, not 5"));
  RobotDescription robot = PendulumRobot();
  robot.training.hidden = {12};
  TrainingSession other_network(robot, MakeGymPendulum, 2, 4, 1);
  CHECK_THROWS_WITH(other_network.Restore(checkpoint), Catch::Contains("another robot or network"));
  robot = PendulumRobot();
  ++robot.fingerprint;  // another effort limit, say
  TrainingSession changed_robot(robot, MakeGymPendulum, 2, 4, 1);
  CHECK_THROWS_WITH(changed_robot.Restore(checkpoint), Catch::Contains("has changed since"));
  robot = PendulumRobot();
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
