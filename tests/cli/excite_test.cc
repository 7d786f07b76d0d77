// `plumb excite`, run as a person would.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <sstream>
#include <string>

#include "tests/cli/shell.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

Outcome Excite(const std::string& robot, const std::string& arguments) {
  return Shell(Plumb() + "excite " + Robot(robot) + " " + arguments);
}

}  // namespace

TEST_CASE(
    "excite: a table of efforts within the limits, one row per control step, the same for the same "
    "seed") {
  const TemporaryFolder folder;
  const std::string few = " --candidates 11 --seconds 3 --output ";
  const Outcome outcome =
      Excite("pendulum", "--seed 3" + few + folder / "a.csv" + " --png " + folder / "a.png");
  INFO(outcome.text);
  REQUIRE(outcome.status == 0);
  for (const char* word : {"gain [nat]", "present sd", "expected sd", "margin", "helps with",
                           "gravity", "it begins at"}) {
    CHECK_THAT(outcome.text, Catch::Contains(word));
  }
  std::istringstream csv(Read(folder / "a.csv"));
  std::string line;
  std::getline(csv, line);
  CHECK(line == "t,u/pivot");
  int rows = 0;
  double largest = 0;
  for (; std::getline(csv, line); ++rows) {
    double t, u;
    REQUIRE(std::sscanf(line.c_str(), "%lf,%lf", &t, &u) == 2);
    CHECK(t == Approx(0.05 * rows));
    largest = std::max(largest, std::abs(u));
  }
  CHECK(rows == 60);
  CHECK(largest <= 2);  // Nm
  CHECK(largest > 0.1);
  CHECK(Read(folder / "a.png").rfind("\x89PNG", 0) == 0);
  CHECK(Excite("pendulum", "--seed 3" + few + folder / "b.csv").status == 0);
  CHECK(Read(folder / "a.csv") == Read(folder / "b.csv"));
  CHECK(Excite("pendulum", "--seed 4" + few + folder / "b.csv").status == 0);
  CHECK(Read(folder / "a.csv") != Read(folder / "b.csv"));
}

TEST_CASE("excite: a robot whose base floats, which has more coordinates than velocities") {
  const TemporaryFolder folder;
  const Outcome outcome =
      Excite("quadruped", "--candidates 1 --seconds 0.2 --output " + (folder / "a.csv") +
                              " --png " + (folder / "a.png"));
  INFO(outcome.text);
  CHECK(outcome.status == 0);
  CHECK(Read(folder / "a.png").rfind("\x89PNG", 0) == 0);
}

TEST_CASE("a program that was started to outlive its terminal does") {
  // as nohup starts it; it is hung up on before it can look
  const Outcome outcome =
      Shell("trap '' HUP; exec env --block-signal=HUP sh -c 'kill -HUP $$; exec " + Plumb() +
            "excite " + Robot("pendulum") + " --candidates 2 --seconds 1'");
  INFO(outcome.text);
  CHECK(outcome.status == 0);
}

TEST_CASE("excite: one joint after the other moves if it is to be so") {
  const TemporaryFolder folder;
  const Outcome outcome = Excite(
      "double_pendulum", "--one-by-one --candidates 6 --seconds 4 --output " + folder / "a.csv");
  INFO(outcome.text);
  REQUIRE(outcome.status == 0);
  std::istringstream csv(Read(folder / "a.csv"));
  std::string line;
  std::getline(csv, line);
  CHECK(line == "t,u/shoulder,u/elbow");
  double moved[2]{};
  while (std::getline(csv, line)) {
    double t, u[2];
    REQUIRE(std::sscanf(line.c_str(), "%lf,%lf,%lf", &t, &u[0], &u[1]) == 3);
    CHECK((t < 2 ? u[1] : u[0]) == 0);
    for (int i = 0; i < 2; ++i) moved[i] = std::max(moved[i], std::abs(u[i]));
  }
  CHECK(moved[0] > 0.01);
  CHECK(moved[1] > 0.01);
}

TEST_CASE("excite: of the falling hopper only what comes before the fall, in gym's units") {
  const TemporaryFolder folder;
  const Outcome outcome =
      Excite("hopper", "--candidates 6 --seconds 4 --output " + folder / "a.csv");
  INFO(outcome.text);
  REQUIRE(outcome.status == 0);
  const std::string csv = Read(folder / "a.csv");
  CHECK(csv.rfind("t,u/thigh,u/leg,u/foot\n", 0) == 0);
  CHECK(std::count(csv.begin(), csv.end(), '\n') < 250);  // of 500
}

TEST_CASE("excite: can be interrupted while it computes") {
  const TemporaryFolder folder;
  const Outcome outcome =
      ShellAskedToEnd(Plumb() + "excite " + Robot("hopper") +
                      " --candidates 10000 --seconds 60 --output " + folder / "a.csv");
  INFO(outcome.text);
  CHECK(outcome.status == 130);
  CHECK(Read(folder / "a.csv").empty());
}

TEST_CASE("excite: what cannot be done is said before anything is computed") {
  const TemporaryFolder folder;
  CHECK(Excite("pendulum", "--candidates 0").status != 0);
  CHECK(Excite("pendulum", "--seconds 0").status != 0);
  CHECK(Excite("nowhere", "").status != 0);
  const Outcome nowhere = Excite("pendulum", "--candidates 2 --output /nonexistent/a.csv");
  CHECK(nowhere.status != 0);
  CHECK_THAT(nowhere.text, Catch::Contains("/nonexistent/a.csv"));
  const Outcome same =
      Excite("pendulum", "--candidates 2 --output " + folder / "a" + " --png " + folder / "a");
  CHECK(same.status != 0);
  CHECK_THAT(same.text, Catch::Contains("a file each"));
}

}  // namespace plumb
