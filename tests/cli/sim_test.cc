// `plumb sim`, run as a person would: with which policies and parameters, what it refuses, and how
// it is interrupted. What it writes is in sim_output_test.cc.
#include <sys/stat.h>

#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "cli/roll_out.h"
#include "controller/policy.h"
#include "robot/description.h"
#include "robot/posterior_reader.h"
#include "tests/cli/sim_table.h"
#include "tests/temporary_folder.h"
#include "trainer/checkpoint.h"
#include "trainer/onnx_policy.h"

namespace plumb {

namespace fs = std::filesystem;

TEST_CASE("sim: a table of efforts is played, row by row") {
  const TemporaryFolder folder;
  const auto write = [&](const std::string& text) {
    std::ofstream(folder / "efforts.csv") << text;
    return folder / "efforts.csv";
  };
  std::string csv = "t,u/pivot,q/pivot\n";
  for (int k = 0; k < 30; ++k) csv += fmt::format("{},{},0\n", 0.05 * k, 0.0625 * (k - 15));
  const Outcome good = Sim(Robot("pendulum") + " --episodes 2 --efforts " + write(csv) + " --csv " +
                           folder / "a.csv");
  INFO(good.text);
  REQUIRE(good.status == 0);
  CHECK_THAT(good.text, Catch::Contains("the efforts of " + folder / "efforts.csv"));
  const SimTable table = ReadSimTable(folder / "a.csv");
  REQUIRE(table.rows.size() == 60);
  for (size_t k = 0; k < 60; ++k)
    CHECK(table.at(k, "u/pivot") == 0.0625 * (static_cast<double>(k % 30) - 15));
  CHECK(table.at(29, "truncated") == 1);

  const auto refused = [&](const std::string& text, const std::string& why) {
    const Outcome outcome = Sim(Robot("pendulum") + " --efforts " + write(text));
    INFO(outcome.text);
    CHECK(outcome.status == 1);
    CHECK_THAT(outcome.text, Catch::Contains("efforts.csv:" + why));
  };
  refused("t,u/pivott\n0,0\n", "1: has no column 'u/pivot'; the nearest is 'u/pivott'");
  refused("t,u/pivot\n0,0\n0.05,nan\n", "3: u/pivot is nan: beyond the joint's effort limit");
  refused("t,u/pivot\n0,0\n0.05,2.1\n", "3: u/pivot is 2.1: beyond");
  refused("t,u/pivot\n0,0\n0.06,1\n", "3: t is 0.06, 0.06 s after the row before, but");
  refused("t,u/pivot\n0,0\n,1\n", "3: t must be known");
  refused("t,u/pivot\n", " has a head but no rows");
  CHECK(Sim(Robot("pendulum") + " --efforts none.csv").status == 1);
  CHECK(Sim(Robot("pendulum") + " --random --efforts " + folder / "efforts.csv").status != 0);
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
  CHECK(ReadSimTable(folder / "a.csv").at(17, "u/pivot") == 1);  // half of 2 Nm

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
    CHECK_THAT(complaint(Robot("pendulum") + " --csv /nonexistent/a.csv --noise=" + noise),
               Contains(std::string("--noise ") + noise + ": expected a standard deviation"));
  }
  CHECK_THAT(complaint(Robot("pendulum") + " --csv /nonexistent/a.csv --noise ''"),
             Contains("expected a standard"));
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

TEST_CASE("sim: a seed is a number from 0") {
  const Outcome outcome = Sim(Robot("pendulum") + " --seed -1");
  CHECK(outcome.status == 2);
  CHECK_THAT(outcome.text, Catch::Contains("--seed"));
  CHECK(Sim(Robot("pendulum") + " --seed 100000000000000000000").status == 2);
  CHECK(Sim(Robot("pendulum") + " --seed 0").status == 0);
  CHECK(Sim(Robot("pendulum") + " --seed 18446744073709551615").status == 0);
  for (const char* flag : {"robot --seed", "controller --seed", "calibrator --seed",
                           "trainer --seed", "calibrator --threads", "trainer --threads"}) {
    const std::string command = std::string(std::getenv("PLUMBLINE_BUILD")) + "/bin/plumb-" + flag +
                                " -1 " + Robot("pendulum");
    INFO(command);
    const Outcome refused = Shell(command);
    CHECK(refused.status == 2);
    CHECK_THAT(refused.text, Catch::Contains("--"));
  }
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

}  // namespace plumb
