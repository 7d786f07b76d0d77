// `plumb sim`, run as a person would.
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fmt/format.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "cli/reading_noise.h"
#include "cli/roll_out.h"
#include "controller/policy.h"
#include "robot/description.h"
#include "robot/posterior_reader.h"
#include "tests/cli/shell.h"
#include "tests/temporary_folder.h"
#include "trainer/checkpoint.h"
#include "trainer/onnx_policy.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

Outcome Sim(const std::string& arguments) {
  return Shell("DISPLAY= " + Plumb() + "sim " + arguments);
}

struct Table {
  std::vector<std::string> names;
  std::vector<std::vector<double>> rows;
  double at(size_t row, const std::string& name) const {
    const auto column = std::find(names.begin(), names.end(), name);
    REQUIRE(column != names.end());
    return rows.at(row).at(static_cast<size_t>(column - names.begin()));
  }
};

Table ReadCsv(const std::string& file) {
  Table table;
  std::ifstream stream(file);
  std::string line, field;
  std::getline(stream, line);
  for (std::istringstream fields(line); std::getline(fields, field, ',');)
    table.names.push_back(field);
  while (std::getline(stream, line)) {
    table.rows.emplace_back();
    for (std::istringstream fields(line); std::getline(fields, field, ',');) {
      table.rows.back().push_back(std::stod(field));
    }
    REQUIRE(table.rows.back().size() == table.names.size());
  }
  return table;
}

}  // namespace

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
  const Table table = ReadCsv(folder / "a.csv");
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
  const Table table = ReadCsv(folder / "a.csv");
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
  CHECK_FALSE(fs::exists(folder / "a.csv.part"));
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
  const Table truth = ReadCsv(folder / "a.csv");
  const std::string noisy = table("12 --noise 0.003,0.1");
  CHECK(table("12 --noise 0.003,0.1") == noisy);
  const Table read = ReadCsv(folder / "a.csv");
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
  const Table both = ReadCsv(folder / "a.csv");
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

TEST_CASE("sim: a trainer's policy, and whatever is not one") {
  const TemporaryFolder folder;
  GaussianPolicy policy(PolicyShape{3, {4}, 1});
  policy.parameters(policy.parameters.size() - 2) = 0.5f;
  policy.action_scale.setConstant(2);
  Checkpoint checkpoint{};
  checkpoint.policy = policy.ToMessage();
  SaveCheckpoint(folder / "good", checkpoint);
  const Outcome good =
      Sim(Robot("pendulum") + " --csv " + folder / "a.csv" + " --policy " + folder / "good");
  INFO(good.text);
  REQUIRE(good.status == 0);
  CHECK(ReadCsv(folder / "a.csv").at(17, "u/pivot") == 1);  // half of 2 Nm

  const auto complaint = [&](const std::string& arguments) {
    const Outcome outcome = Sim(arguments);
    CHECK(outcome.status == 1);
    return outcome.text;
  };
  using Catch::Contains;
  CHECK_THAT(complaint(Robot("hopper") + " --policy " + folder / "good"),
             Contains("3 observations into 1 actions") && Contains("has 11 and 3"));
  policy.action_scale.setConstant(3);
  checkpoint.policy = policy.ToMessage();
  SaveCheckpoint(folder / "stronger", checkpoint);
  CHECK_THAT(complaint(Robot("pendulum") + " --policy " + folder / "stronger"),
             Contains("effort limits"));
  CHECK_THAT(complaint(Robot("pendulum") + " --policy " + folder / "none"),
             Contains("there is no such policy"));
  CHECK_THAT(
      complaint(Robot("pendulum") + " --policy " + Robot("pendulum/robot.toml")),
      Contains("robot.toml") && Contains("neither a trainer's checkpoint nor an ONNX model"));
}

TEST_CASE("sim: a policy in ONNX does what it does as a checkpoint, on its own robot") {
  const TemporaryFolder folder;
  const RobotDescription robot = LoadRobot(Robot("pendulum"));
  GaussianPolicy policy(PolicyShape{3, {4}, 1});
  for (Eigen::Index i = 0; i < policy.parameters.size(); ++i)
    policy.parameters[i] = 0.1f * static_cast<float>(i % 7 - 3);
  policy.action_scale.setConstant(2);
  Checkpoint checkpoint{};
  checkpoint.policy = policy.ToMessage();
  SaveCheckpoint(folder / "checkpoint", checkpoint);
  WriteOnnxPolicy(folder / "policy.onnx", {policy, MakePolicyRecord(robot, *MakeTask(robot))});
  const auto table = [&](const std::string& file) {
    const Outcome outcome =
        Sim(Robot("pendulum") + " --csv " + folder / "a.csv" + " --policy " + folder / file);
    INFO(outcome.text);
    CHECK(outcome.status == 0);
    return Read(folder / "a.csv");
  };
  CHECK(table("policy.onnx") == table("checkpoint"));
  const Outcome other = Sim(Robot("hopper") + " --policy " + folder / "policy.onnx");
  CHECK(other.status == 1);
  CHECK_THAT(other.text,
             Catch::Contains(
                 "policy.onnx: the policy is for another robot: \"pendulum\", not \"hopper\""));
}

TEST_CASE("sim: errors say what to do") {
  const auto complaint = [&](const std::string& arguments) {
    const Outcome outcome = Sim(arguments);
    CHECK(outcome.status == 1);
    return outcome.text;
  };
  using Catch::Contains;
  CHECK_THAT(complaint(Robot("hopper") + " --set mass/tigh=4"),
             Contains("'mass/tigh'") && Contains("'mass/thigh'"));
  CHECK_THAT(complaint(Robot("hopper") + " --set mass/thigh=-1"), Contains("mass/thigh"));
  CHECK_THAT(complaint(Robot("hopper") + " --set mass/thigh"), Contains("mass/thigh=4"));
  CHECK_THAT(complaint(Robot("pendulum") + " --set gravity=nine"), Contains("gravity=nine"));
  for (const char* noise :
       {"-0.1", "nan", "inf", "1e999", "0.1,-1", "0.1,", ",0.1", "0.1,0.2,0.3", "little"}) {
    CHECK_THAT(complaint(Robot("pendulum") + " --noise=" + noise),
               Contains(std::string("--noise ") + noise + ": expected a standard deviation"));
  }
  CHECK_THAT(complaint(Robot("pendulum") + " --noise ''"), Contains("expected a standard"));
  CHECK_THAT(complaint(Robot("pendulum") + " --csv /nonexistent/a.csv"),
             Contains("/nonexistent/a.csv"));
  CHECK_THAT(complaint(Robot("pendulum") + " --png /"), Contains("folder"));
  CHECK_THAT(complaint(Robot("nonesuch")), Contains("no such robot"));
  CHECK(Sim(Robot("pendulum") + " --random --policy x").status != 0);
  CHECK(Sim(Robot("pendulum") + " --episodes 0").status != 0);
}

TEST_CASE("sim: outputs that could not be written are refused before anything is simulated") {
  const TemporaryFolder folder;
  using Catch::Contains;
  const auto complaint = [&](const std::string& arguments) {
    const Outcome outcome = Sim(Robot("pendulum") + " " + arguments);
    CHECK(outcome.status == 1);
    CHECK_THAT(outcome.text, !Contains("episode"));
    return outcome.text;
  };
  CHECK_THAT(complaint("--csv " + folder / "a --png " + folder / "a"),
             Contains(folder / "a") && Contains("a file each"));
  CHECK_THAT(complaint("--png " + folder / "a --gif " + folder / "./a"), Contains("a file each"));
  CHECK_THAT(complaint("--csv " + folder / "a --gif " + folder / "a.part"),
             Contains("a file each"));
  // rather than itself: this may be root, and a rename harm it
  fs::create_symlink("/dev/null", folder / "null");
  CHECK_THAT(complaint("--csv " + folder / "null"),
             Contains("null: cannot be written: it is not a regular file"));
  CHECK(fs::is_symlink(folder / "null"));
  REQUIRE(mkfifo((folder / "pipe").c_str(), 0600) == 0);
  CHECK_THAT(complaint("--gif " + folder / "pipe"), Contains("not a regular file"));
  CHECK_THAT(complaint("--csv /proc/x.csv"), Contains("/proc/x.csv: cannot be written"));
  std::ofstream(folder / "old") << "old";
  CHECK_THAT(complaint("--csv " + folder / "old --set gravity=-1"), Contains("gravity"));
  CHECK(Read(folder / "old") == "old");
  CHECK_FALSE(fs::exists(folder / "old.part"));
}

TEST_CASE("sim: what is not a regular file is no robot and no policy") {
  const TemporaryFolder folder;
  using Catch::Contains;
  const std::string pipe = folder / "pipe";
  REQUIRE(mkfifo(pipe.c_str(), 0600) == 0);
  CHECK_THAT(Sim(pipe).text, Contains(pipe + ": is not a regular file"));
  CHECK_THAT(Sim(Robot("pendulum") + " --policy " + pipe).text,
             Contains(pipe + " is not a regular file"));
  CHECK_THAT(Sim(Robot("pendulum") + " --policy /tmp").text,
             Contains("/tmp is not a regular file"));
}

TEST_CASE("sim: can be interrupted between short episodes") {
  // Each of the pendulum's has 200 steps.
  const Outcome outcome =
      Shell("exec " + Plumb() + "sim " + Robot("pendulum") + " --random --episodes 1000000",
            "time limit");
  CHECK(outcome.status == 130);
  CHECK_THAT(outcome.text, Catch::EndsWith("interrupted\n"));
}

TEST_CASE("sim: stop is asked at every step") {
  Environment environment(LoadRobot(Robot("pendulum")));
  const Actor actor = [](const Eigen::VectorXf&, Random&) {
    return Eigen::VectorXf::Zero(1).eval();
  };
  int asked = 0;
  const EpisodeSummary episode = PlayEpisode(
      environment, LoadRobot(Robot("pendulum")), actor, 1, 0, [](const SimulatedStep&) {},
      [&] { return ++asked == 3; });
  CHECK(episode.end == EpisodeSummary::End::kInterrupted);
  CHECK(episode.steps == 3);
}

TEST_CASE("sim: episodes that failed have no return") {
  using End = EpisodeSummary::End;
  const EpisodeSummary good{10, 1, End::kTimeLimit}, better{20, 3, End::kTerminated},
      failed{5, NAN, End::kNotFinite};
  CHECK(Totals({good, failed, better}) ==
        "3 episodes, 35 steps, mean return 2.0, standard deviation 1.4; 1 failed: no longer "
        "finite, left out "
        "of the mean");
  CHECK(Totals({good}) == "1 episode, 10 steps, mean return 1.0");
  CHECK(Totals({failed, failed}) == "2 episodes, 10 steps; 2 failed: no longer finite");
}

TEST_CASE("sim: a seed is a number from 0") {
  const Outcome outcome = Sim(Robot("pendulum") + " --seed -1");
  CHECK(outcome.status == 2);
  CHECK_THAT(outcome.text, Catch::Contains("--seed"));
  CHECK(Sim(Robot("pendulum") + " --seed 100000000000000000000").status == 2);
  CHECK(Sim(Robot("pendulum") + " --seed 0").status == 0);
  CHECK(Sim(Robot("pendulum") + " --seed 18446744073709551615").status == 0);
}

TEST_CASE("sim: says which parameters are in use") {
  using Catch::Contains;
  const TemporaryFolder folder;
  const std::string hopper = Robot("hopper"), csv = " --csv " + folder / "a.csv";
  const std::string prior = Sim(hopper + csv).text;
  const std::string priors_table = Read(folder / "a.csv");
  CHECK_THAT(
      prior,
      Contains("\nparameters: mass/torso 3.8, mass/thigh 3.8, mass/leg 3.8, mass/foot 3.8\n"));
  CHECK_THAT(Sim(hopper + " --set mass/leg=2.5 --set damping/leg=0.7").text,
             Contains("mass/leg 2.5, mass/foot 3.8, damping/leg 0.7\n"));
  // As the URDF has it: not the prior's means.
  CHECK_THAT(Sim(hopper + csv + " --urdf").text, Contains("parameters: none"));
  const std::string table = Read(folder / "a.csv");
  CHECK(table != priors_table);
  std::string set;
  for (const LinkDescription& link : LoadRobot(hopper).links) {
    if (link.mass > 0 && link.name != LoadRobot(hopper).links[0].name) {
      std::ostringstream flag;
      flag.precision(17);
      flag << " --set mass/" << link.name << "=" << link.mass;
      set += flag.str();
    }
  }
  const Outcome explicitly = Sim(hopper + csv + set);
  INFO(explicitly.text);
  CHECK(Read(folder / "a.csv") == table);
  CHECK_THAT(Sim(hopper + " --urdf --set gravity=3").text, Contains("parameters: gravity 3\n"));
  for (std::istringstream lines(
           Sim(hopper + set + " --set damping/leg=0.123456789 --set damping/foot=0.123456789")
               .text);
       std::getline(lines, set);) {
    CHECK(set.size() <= 120);
  }
}

TEST_CASE("sim: a posterior's means instead of the prior's") {
  using Catch::Contains;
  const TemporaryFolder folder;
  const std::string pendulum = Robot("pendulum"), posterior = folder / "posterior.json";
  Sim(pendulum + " --random --episodes 2 --seed 7 --set mass/pole=1.2 --csv " + folder / "a.csv");
  const Outcome calibration = Shell(Plumb() + "calibrate " + pendulum + " --csv " +
                                    folder / "a.csv" + " --method laplace --output " + posterior);
  INFO(calibration.text);
  REQUIRE(calibration.status == 0);
  const Outcome outcome = Sim(pendulum + " --posterior " + posterior);
  INFO(outcome.text);
  CHECK(outcome.status == 0);
  const Eigen::VectorXd means = ReadPosterior(posterior, LoadRobot(pendulum)).Mean();
  CHECK_THAT(outcome.text, Contains(fmt::format("mass/pole {}", means(1))));
  CHECK_THAT(Sim(pendulum + " --set gravity=3 --posterior " + posterior).text,
             Contains(fmt::format("gravity 3, mass/pole {}", means(1))));
  CHECK_THAT(Sim(Robot("hopper") + " --posterior " + posterior).text,
             Contains("is another robot's"));
  CHECK(Sim(pendulum + " --urdf --posterior " + posterior).status == 2);
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
