#include "calibrator/live/session.h"

#include <catch2/catch.hpp>
#include <filesystem>
#include <string>

#include "calibrator/live/calibrator.h"
#include "calibrator/live/checkpoint.h"
#include "calibrator/live/simopt.h"
#include "common/clock.h"
#include "robot/posterior_reader.h"
#include "tests/calibrator/live/known_pendulum.h"
#include "tests/calibrator/synthetic.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

TEST_CASE("a session goes on from what its folder holds, and writes what it has found") {
  const RobotDescription robot = Pendulum();
  const Clock clock;
  const TemporaryFolder folder;
  CalibrationSession::Settings settings{
      .folder = folder.path().string(), .method = "reps", .seed = 9, .threads = 1};
  {
    CalibrationSession session(robot, settings, clock);
    CHECK_FALSE(session.busy());
    CHECK_FALSE(session.Work());
    CHECK(session.Distribution().iteration == 0);
    CHECK_THROWS_WITH(CalibrationSession(robot, settings, clock),
                      Catch::Contains("another calibrator is at work there"));
  }
  SimOpt straight(robot, 9, 1, "reps");
  Iterate(straight, robot, 1);
  CalibrationCheckpoint(folder.path(), robot, 9).Save(straight.state());

  SECTION("of another method, or anew where that is asked for") {
    settings.method = "laplace";
    CHECK_THROWS_WITH(
        CalibrationSession(robot, settings, clock),
        Catch::StartsWith(settings.folder) && Catch::Contains("made by method reps, not laplace"));
    settings.anew = true;
    CHECK(CalibrationSession(robot, settings, clock).Status().iteration == 0);
    CHECK_FALSE(std::filesystem::exists(folder / "posterior_1.json"));
  }
  SECTION("with the findings of an iteration that was complete") {
    CHECK(CalibrationSession(robot, settings, clock).Status().iteration == 1);
    CHECK(ReadPosterior(folder / "posterior_1.json", robot).mixture ==
          straight.state().distribution);
  }
  SECTION("in the middle of an iteration") {
    straight.Begin({Synthetic(robot, 1)});
    CalibrationCheckpoint(folder.path(), robot, 9).Save(straight.state());
    Finish(straight);
    CalibrationSession session(robot, settings, clock);
    for (int update = 0; session.busy() && !session.Work(); ++update) REQUIRE(update < 100);
    CHECK_FALSE(session.busy());
    CHECK(session.Status().iteration == 2);
    CHECK(session.Status().mean == StatusMessage(robot, straight.state(), {}, nullptr, 0).mean);
    CHECK(ReadPosterior(folder / "posterior_2.json", robot).mixture ==
          straight.state().distribution);
  }
}

}  // namespace
}  // namespace plumb
