// What `plumb sim` writes: tables, noise in their readings, totals and pictures.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "cli/reading_noise.h"
#include "cli/roll_out.h"
#include "robot/description.h"
#include "tests/cli/sim_table.h"
#include "tests/temporary_folder.h"

namespace plumb {

TEST_CASE("sim: the pendulum's table, number by number") {
  const TemporaryFolder folder;
  const Outcome outcome =
      Sim(Robot("pendulum") + " --random --episodes 2 --seed 7 --csv " + folder / "a.csv");
  INFO(outcome.text);
  REQUIRE(outcome.status == 0);
  CHECK(outcome.text.find("time limit") != std::string::npos);
  CHECK(outcome.text.find("2 episodes, 400 steps") != std::string::npos);
  CHECK(
      Read(folder / "a.csv").rfind("t,q/pivot,v/pivot,u/pivot,reward,terminated,truncated\n", 0) ==
      0);
  const SimTable table = ReadSimTable(folder / "a.csv");
  REQUIRE(table.rows.size() == 400);
  for (size_t row = 0; row < 400; ++row) {
    CHECK(table.at(row, "t") == Approx(0.05 * static_cast<double>(row % 200)));
    const double angle = std::remainder(table.at(row, "q/pivot"), 2 * M_PI),
                 v = table.at(row, "v/pivot");
    const double u = table.at(row, "u/pivot");
    CHECK(std::abs(u) <= 2);  // Nm
    CHECK(table.at(row, "reward") ==
          Approx(-(angle * angle + 0.1 * v * v + 0.001 * u * u)).epsilon(1e-12));
    CHECK(table.at(row, "terminated") == 0);
    CHECK(table.at(row, "truncated") == (row % 200 == 199 ? 1 : 0));
  }
  CHECK(table.at(0, "q/pivot") != table.at(200, "q/pivot"));
}

TEST_CASE("sim: a motor's protocol that there is not is told, though nothing is driven") {
  const TemporaryFolder folder;
  std::ofstream(folder / "robot.toml")
      << "extends = \"" + Robot("pendulum") + "/robot.toml\"\n[robot]\nurdf = \"" +
             Robot("pendulum") +
             "/robot.urdf\"\n[[joint]]\nname = \"pivot\"\nprotocol = "
             "\"cansimpel\"\n";
  const Outcome outcome = Sim(folder / "robot.toml --random");
  INFO(outcome.text);
  CHECK(outcome.status == 0);
  CHECK_THAT(outcome.text,
             Catch::Contains("robot.toml:6:12: joint pivot: unknown motor protocol 'cansimpel'; "
                             "known: cansimple, ") &&
                 Catch::Contains("pendulum cannot be driven: "));
  CHECK(Sim(Robot("hopper") + " --random").text.find("cannot be driven") == std::string::npos);
}

TEST_CASE("sim: the hopper's table") {
  const TemporaryFolder folder;
  const Outcome outcome = Sim(Robot("hopper") + " --random --episodes 3 --csv " + folder / "a.csv");
  INFO(outcome.text);
  REQUIRE(outcome.status == 0);
  CHECK(outcome.text.find("terminated by the task") != std::string::npos);
  CHECK(Read(folder / "a.csv")
            .rfind("t,q/rootx,q/rootz,q/rooty,q/thigh,q/leg,q/foot,v/rootx,v/rootz,v/rooty,v/"
                   "thigh,v/leg,v/foot,"
                   "u/thigh,u/leg,u/foot,reward,terminated,truncated\n",
                   0) == 0);
  const SimTable table = ReadSimTable(folder / "a.csv");
  int episodes = 0;
  for (size_t row = 0; row < table.rows.size(); ++row) {
    double cost = 0;
    for (const char* u : {"u/thigh", "u/leg", "u/foot"}) {
      CHECK(std::abs(table.at(row, u)) <= 1);
      cost += 1e-3 * std::pow(table.at(row, u), 2);
    }
    if (table.at(row, "t") == 0) {
      CHECK(table.at(row, "q/rootz") == Approx(1.25).margin(0.005));
      ++episodes;
    } else {
      CHECK(table.at(row, "t") == Approx(table.at(row - 1, "t") + 0.008));
    }
    if (table.at(row, "terminated") == 0) {
      const double way = table.at(row + 1, "q/rootx") - table.at(row, "q/rootx");
      CHECK(table.at(row, "reward") == Approx(way / 0.008 + 1 - cost).epsilon(1e-12));
    }
  }
  CHECK(episodes == 3);
  CHECK(table.rows.size() > 9);
}

TEST_CASE("sim: equal seeds give equal bytes, other seeds and parameters others") {
  const TemporaryFolder folder;
  const auto table = [&](const std::string& flags) {
    const Outcome outcome = Sim(Robot("pendulum") + " --csv " + folder / "a.csv" + " " + flags);
    INFO(outcome.text);
    REQUIRE(outcome.status == 0);
    return Read(folder / "a.csv");
  };
  const std::string one = table("--random --seed 1");
  CHECK(table("--random --seed 1") == one);
  CHECK(table("--random --seed 2") != one);
  CHECK(table("--random --seed 1 --set gravity=9 --set mass/pole=1.2") != one);
  CHECK(table("--random --seed 1 --set gravity=10.4") == one);  // its prior mean
  CHECK(table("--random --seed 1 --episodes 2").rfind(one, 0) == 0);
  CHECK(table("--seed 1").find(",0,") != std::string::npos);  // no action
  CHECK(std::distance(std::filesystem::directory_iterator(folder.path()), {}) == 1);
}

TEST_CASE("sim: noise is added to every reading, and to nothing else") {
  const TemporaryFolder folder;
  const auto table = [&](const std::string& flags) {
    const Outcome outcome =
        Sim(Robot("hopper") + " --random --csv " + folder / "a.csv" + " --episodes " + flags);
    INFO(outcome.text);
    REQUIRE(outcome.status == 0);
    return Read(folder / "a.csv");
  };
  const std::string exact = table("12");
  CHECK(table("12 --noise 0") == exact);
  const SimTable truth = ReadSimTable(folder / "a.csv");
  const std::string noisy = table("12 --noise 0.003,0.1");
  CHECK(table("12 --noise 0.003,0.1") == noisy);
  const SimTable read = ReadSimTable(folder / "a.csv");
  REQUIRE(read.rows.size() == truth.rows.size());
  const double count = static_cast<double>(truth.rows.size());
  REQUIRE(count > 150);
  for (size_t column = 0; column < truth.names.size(); ++column) {
    const std::string& name = truth.names[column];
    double sum = 0, squares = 0, with_next = 0, last = 0;
    for (size_t row = 0; row < truth.rows.size(); ++row) {
      const double error = read.rows[row][column] - truth.rows[row][column];
      sum += error, squares += error * error, with_next += error * last, last = error;
    }
    CAPTURE(name);
    if (name[0] != 'q' && name[0] != 'v') {
      CHECK(squares == 0);
      continue;
    }
    // Five standard deviations of what a Gaussian's moments scatter by.
    const double sd = name[0] == 'q' ? 0.003 : 0.1, most = 5 / std::sqrt(count);
    CHECK(std::abs(sum / count) < sd * most);
    CHECK(std::abs(squares / count / (sd * sd) - 1) < std::sqrt(2) * most);
    CHECK(std::abs(with_next / count / (sd * sd)) < most);
  }
  // One number is for both; an episode's noise does not depend on how many there are.
  table("12 --noise 0.1");
  const SimTable both = ReadSimTable(folder / "a.csv");
  CHECK(both.at(0, "v/foot") == read.at(0, "v/foot"));
  CHECK(both.at(0, "q/foot") != read.at(0, "q/foot"));
  CHECK(noisy.rfind(table("3 --noise 0.003,0.1"), 0) == 0);
}

TEST_CASE("sim: noise turns a spherical joint's orientation, whose length stays") {
  RobotDescription robot = LoadRobot(Robot("pendulum"));
  robot.joints[0].type = JointDescription::Type::kSpherical;
  Random random(1);
  double squares = 0;
  for (int i = 0; i < 1000; ++i) {
    Eigen::VectorXd q(4), v = Eigen::VectorXd::Zero(3);
    q << 0.5, -0.5, 0.5, 0.5;
    const Eigen::Vector4d before = q;
    ReadingNoise{0.01, 0}.Add(robot, random, q, v);
    CHECK(q.norm() == Approx(1).epsilon(1e-12));
    CHECK(v.isZero(0));
    squares += std::pow(2 * std::acos(std::min(1.0, q.dot(before))), 2);
  }
  CHECK(squares / 1000 == Approx(3e-4).epsilon(0.15));  // three angles of variance 1e-4
}

TEST_CASE("sim: episodes that failed have no return") {
  using End = EpisodeSummary::End;
  const EpisodeSummary good{10, 1, End::kTimeLimit}, better{20, 3, End::kTerminated},
      failed{5, NAN, End::kNotFinite};
  CHECK(Totals({good, failed, better}) ==
        "3 episodes, 35 steps, mean return 2.0, standard deviation 1.4; 1 failed: the simulation "
        "has blown up, left out of the mean");
  CHECK(Totals({good}) == "1 episode, 10 steps, mean return 1.0");
  CHECK(Totals({failed, failed}) == "2 episodes, 10 steps; 2 failed: the simulation has blown up");
}

TEST_CASE("sim: pictures") {
  const TemporaryFolder folder;
  const Outcome outcome =
      Sim(Robot("hopper") + " --random --png " + folder / "a.png" + " --gif " + folder / "a.gif");
  INFO(outcome.text);
  REQUIRE(outcome.status == 0);
  CHECK(Read(folder / "a.png").substr(1, 3) == "PNG");
  CHECK(Read(folder / "a.gif").substr(0, 6) == "GIF89a");
}

TEST_CASE("sim: a spherical joint has four columns in q and three in v") {
  RobotDescription robot = LoadRobot(Robot("pendulum"));
  robot.joints.insert(robot.joints.begin(), robot.joints[0]);
  robot.joints[0].name = "body/rotation";
  robot.joints[0].type = JointDescription::Type::kSpherical;
  robot.joints[0].passive = true;
  CHECK(CsvHeader(robot) ==
        "t,q/body/rotation/w,q/body/rotation/x,q/body/rotation/y,q/body/rotation/z,q/pivot,"
        "v/body/rotation/x,v/body/rotation/y,v/body/rotation/z,v/pivot,u/"
        "pivot,reward,terminated,truncated\n");
}

}  // namespace plumb
