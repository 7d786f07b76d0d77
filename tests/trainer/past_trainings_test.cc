// A run that begins anew and finds what an earlier life of it has trained.
#include "trainer/past_trainings.h"

#include <catch2/catch.hpp>
#include <memory>

#include "common/atomic_file.h"
#include "tests/temporary_folder.h"
#include "tests/trainer/pendulum_session.h"

namespace plumb {
namespace {

constexpr uint64_t kRun = 7;

/// One life of the run: a session, and what it finds.
struct Life {
  explicit Life(const TemporaryFolder& f, uint64_t run = kRun, int iterations = 2)
      : folder(f), session(NewSession(4, iterations)), past(f.path(), run) {}

  void Begin(int iteration) {
    REQUIRE(session.Begin(Distribution(iteration)));
    past.Begin(session);
  }
  /// So many updates, or all. @return how many of them had to be computed.
  int Train(int updates = 100) {
    int computed = 0;
    for (; session.training() && updates > 0; --updates) {
      if (const auto status = past.Repeat(session)) {
        said.push_back(*status);
        continue;
      }
      ++computed;
      session.Advance();
      past.Add(session.Status());
      said.push_back(session.Status());
    }
    if (!past.repeating()) past.Keep(session);
    return computed;
  }
  std::string Bytes() const { return EncodeCheckpoint(past.MakeCheckpoint(session)); }

  const TemporaryFolder& folder;
  TrainingSession session;
  PastTrainings past;
  std::vector<training_status_t> said;
};

TEST_CASE("a run that begins anew says the same, and computes what nobody has computed") {
  const TemporaryFolder elsewhere, folder;
  Life straight(elsewhere);
  straight.Begin(0);
  CHECK(straight.Train() == 6);
  REQUIRE(straight.session.AddTrial(Tried(0, -1)));
  straight.Begin(1);
  CHECK(straight.Train() == 2);
  // Killed in the first training, then in the second, when the first has been tried.
  Life first(folder);
  first.Begin(0);
  CHECK(first.Train(4) == 4);
  Life second(folder);
  second.Begin(0);
  CHECK(second.Train() == 2);
  REQUIRE(second.session.AddTrial(Tried(0, -1)));
  second.Begin(1);
  CHECK(second.Train(1) == 1);
  Life third(folder);
  third.Begin(0);
  CHECK(third.Train() == 0);
  REQUIRE(third.session.AddTrial(Tried(0, -1)));
  third.Begin(1);
  CHECK(third.Train() == 1);
  CHECK(third.Bytes() == straight.Bytes());
  REQUIRE(third.said.size() == straight.said.size());
  for (size_t i = 0; i < third.said.size(); ++i) {
    INFO(i);
    CHECK(third.said[i].update == straight.said[i].update);
    CHECK(third.said[i].kl == straight.said[i].kl);
    CHECK(third.said[i].steps == straight.said[i].steps);
    CHECK(third.said[i].complete == straight.said[i].complete);
  }
}

TEST_CASE("a past training that is damaged is trained again") {
  const TemporaryFolder folder;
  Life first(folder);
  first.Begin(0);
  CHECK(first.Train() == 6);
  WriteAtomically(folder / "trainer_0.checkpoint", "PLUMBTRN and nothing more");
  Life second(folder);
  second.Begin(0);
  CHECK(second.Train() == 6);
  CHECK(second.Bytes() == first.Bytes());
}

TEST_CASE("what was trained of something else is trained again") {
  const TemporaryFolder folder;
  Life before(folder);
  before.Begin(0);
  REQUIRE(before.Train() == 6);
  SECTION("another robot, or other settings") {
    Life other(folder, kRun + 1);
    other.Begin(0);
    CHECK(other.Train() == 6);
  }
  SECTION("another beginning: another trial of the policy before") {
    REQUIRE(before.session.AddTrial(Tried(0, -1)));
    before.Begin(1);
    REQUIRE(before.Train() == 2);
    Life other(folder);
    other.Begin(0);
    CHECK(other.Train() == 0);
    REQUIRE(other.session.AddTrial(Tried(0, -2)));
    other.Begin(1);
    CHECK(other.Train() == 2);
  }
  SECTION("an iteration that was not the last, and is") {
    Life other(folder, kRun, 0);
    other.Begin(0);
    CHECK(other.Train() == 6);
  }
  SECTION("a distribution that was replaced meanwhile") {
    const TemporaryFolder elsewhere;
    Life replaced(elsewhere);
    replaced.Begin(0);
    replaced.Train(3);
    replaced.past.Forget();
    REQUIRE(replaced.Train() == 3);
    Life other(elsewhere);
    other.Begin(0);
    CHECK(other.Train() == 6);
  }
  SECTION("a distribution that was replaced while its trainings were repeated") {
    Life other(folder);
    other.Begin(0);
    CHECK(other.Train(2) == 0);
    other.past.Forget();
    CHECK_FALSE(other.past.repeating());
    CHECK(other.Train() == 6);
  }
}

}  // namespace
}  // namespace plumb
