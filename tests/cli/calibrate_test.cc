// `plumb calibrate`, run as a person would.
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/cli/shell.h"
#include "tests/mpirun.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// Without what may differ between two runs of the same calibration.
json Posterior(const std::string& file) {
  std::ifstream stream(file);
  REQUIRE(stream);
  json j = json::parse(stream);
  REQUIRE(j.contains("run"));
  j.erase("run");
  return j;
}

std::string HopperTable(const TemporaryFolder& folder, int episodes = 20) {
  const std::string file = folder / "hopper.csv";
  REQUIRE(Shell(Plumb() + "sim " + Robot("hopper") + " --random --episodes " +
                std::to_string(episodes) +
                " --seed 3 --set mass/torso=3.6 mass/thigh=4.1 "
                "mass/leg=2.8 mass/foot=5.2 --csv " +
                file)
              .status == 0);
  return file;
}

TEST_CASE(
    "plumb calibrate finds the masses of a hopper from plumb sim's own table, and says so "
    "everywhere") {
  const TemporaryFolder folder;
  const std::string table = HopperTable(folder);
  const Outcome outcome =
      Shell(Plumb() + "calibrate " + Robot("hopper") + " --csv " + table + " --output " +
            (folder / "p.json") + " --report " + (folder / "r.html") + " --urdf " +
            (folder / "identified.urdf") + " --strict");
  INFO(outcome.text);
  REQUIRE(outcome.status == 0);
  for (const char* words : {"every parameter is determined",
                            "the posterior predicts better than the prior", "mass/foot"}) {
    CHECK(outcome.text.find(words) != std::string::npos);
  }
  const json found = Posterior(folder / "p.json");
  const std::vector<double> truth{3.6, 4.1, 2.8, 5.2};
  for (size_t i = 0; i < truth.size(); ++i)
    CHECK(found["mean"][i].get<double>() == Approx(truth[i]).epsilon(1e-8));
  CHECK_FALSE(found["alarm"]["raised"].get<bool>());
  CHECK(found["holdout"]["better"].get<bool>());
  CHECK_FALSE(fs::exists(folder / "p.json.journal"));
  CHECK(fs::file_size(folder / "r.html") > 10'000);
  CHECK(fs::exists(folder / "identified.urdf"));
}

TEST_CASE(
    "a calibration whose journal finds no more room goes on to the same bits, with any number of "
    "threads") {
  const TemporaryFolder folder;
  const std::string table = HopperTable(folder);
  const std::string command = Plumb() + "calibrate " + Robot("hopper") + " --csv " + table +
                              " --method reps --budget 100000 --output ";
  REQUIRE(Shell(command + (folder / "whole.json") + " --threads 1").status == 0);
  const json whole = Posterior(folder / "whole.json");
  // The journal may grow so far, to the end of a record or not.
  int ended = 0;
  for (const int blocks : {1, 300, 900, 1800, 3000}) {
    const Outcome outcome =
        Shell("ulimit -f " + std::to_string(blocks) + "; exec " + command +
              (folder / "ended.json") + " --threads " + std::to_string(1 + ended % 2));
    INFO(outcome.text);
    REQUIRE(outcome.status == 1);
    CHECK_THAT(outcome.text,
               Catch::Contains("ended.json.journal: cannot be written: File too large"));
    ++ended;
  }
  const Outcome last = Shell(command + (folder / "ended.json") + " --threads 2");
  REQUIRE(last.status == 0);
  CHECK(last.text.find("went on from") != std::string::npos);
  CHECK(Posterior(folder / "ended.json") == whole);
}

TEST_CASE("a journal is not taken up for a table that has been corrected since") {
  const TemporaryFolder folder;
  const std::string table = HopperTable(folder, 4);
  const auto calibrate = [&](const std::string& output) {
    return Plumb() + "calibrate " + Robot("hopper") + " --csv " + table +
           " --method reps --budget 20000 --output " + (folder / output);
  };
  REQUIRE(Shell("ulimit -f 900; exec " + calibrate("p.json")).status == 1);
  // Its clock had been slow by a hundredth, which a step's duration alone tells.
  REQUIRE(Shell("awk -F , -v OFS=, 'NR > 1 { $1 = sprintf(\"%.9f\", 1.01 * $1) } 1' " + table +
                " >" + table + ".new && mv " + table + ".new " + table)
              .status == 0);
  const Outcome corrected = Shell(calibrate("p.json"));
  INFO(corrected.text);
  REQUIRE(corrected.status == 0);
  CHECK(corrected.text.find("went on from") == std::string::npos);
  REQUIRE(Shell(calibrate("fresh.json")).status == 0);
  CHECK(Posterior(folder / "p.json") == Posterior(folder / "fresh.json"));
}

TEST_CASE("ranks that share the work come to the same bits") {
  if (!HaveMpirun()) return;
  const TemporaryFolder folder;
  const std::string table = HopperTable(folder, 6);
  const std::string arguments =
      "calibrate " + Robot("hopper") + " --csv " + table + " --threads 1 --output ";
  REQUIRE(Shell(Plumb() + arguments + (folder / "one.json")).status == 0);
  const Outcome three = Shell(Mpirun(3, Plumb() + arguments + (folder / "three.json")));
  INFO(three.text);
  REQUIRE(three.status == 0);
  CHECK(Posterior(folder / "three.json") == Posterior(folder / "one.json"));
}

TEST_CASE("a rank that is asked to stop does not let the others wait for it") {
  if (!HaveMpirun()) return;
  const TemporaryFolder folder;
  const std::string one = Plumb() + "calibrate " + Robot("hopper") + " --csv " +
                          HopperTable(folder, 4) + " --method reps --threads 1 --output " +
                          (folder / "p.json");
  const Outcome outcome = Shell(Mpirun(1, one) + " : -n 1 env --block-signal=TERM sh -c " +
                                "'kill $$; exec " + one + "'");
  INFO(outcome.text);
  CHECK(outcome.status != 0);
  CHECK(outcome.status != 124);  // timeout's
}

// A posterior whose residual has an input more than the robot.
void AddInput(json* posterior) {
  json& free = (*posterior)["residual"]["free"];
  for (const char* list : {"mean", "scale", "low", "high"}) free[list].push_back(1);
  for (json& row : free["centres"]) row.push_back(1);
  for (json& draw : free["weights"]) {
    for (json& row : draw) row.push_back(1);
  }
}

TEST_CASE("what a model lacks is learnt, told everywhere, and simulated and trained with") {
  const TemporaryFolder folder;
  const std::string robot = Robot("pendulum/gym.toml"), table = folder / "a.csv",
                    posterior = folder / "p.json";
  REQUIRE(Shell(Plumb() + "sim " + robot +
                " --random --episodes 3 --seed 3 --noise 0.001 --set friction/pivot=0.5 --csv " +
                table)
              .status == 0);
  const auto calibrate = [&](const std::string& flags) {
    return Shell(Plumb() + "calibrate " + robot + " --csv " + table +
                 " --method laplace --horizons 1 --output " + posterior + flags);
  };
  const auto says = [](const Outcome& outcome, const std::string& words) {
    INFO(outcome.text);
    CHECK(outcome.text.find(words) != std::string::npos);
  };
  const Outcome with =
      calibrate(" --strict --report " + (folder / "r.html") + " --urdf " + (folder / "u.urdf"));
  CHECK(with.status == 3);  // the model is wrong all the same
  for (const char* words :
       {"the learnt residual explains", "pivot, free", "no parameter is determined",
        "train on posterior and residual together", "record the trained policy's motion"})
    says(with, words);
  const json found = Posterior(posterior);
  CHECK(found["gap"]["informed"] == "none");
  CHECK(found["gap"]["free"]["explained"][0].get<double>() > 0.5);
  CHECK(found["coordinate_mean"] == found["prior"]["coordinate_mean"]);
  CHECK(found["residual"]["draws"].size() == 8);
  CHECK(Read(folder / "r.html").find("What the model lacks") != std::string::npos);
  CHECK(Read(folder / "u.urdf").find("is in no URDF") != std::string::npos);

  const Outcome simulated =
      Shell(Plumb() + "sim " + robot + " --random --seed 5 --posterior " + posterior);
  CHECK(simulated.status == 0);
  says(simulated, "residual: what " + posterior + " has learnt");
  CHECK(Shell(Plumb() + "sim " + robot + " --set gravity=9 damping/pivot=0.1 --posterior " +
              posterior)
            .status == 0);
  const Outcome trained =
      Shell(Plumb() + "train " + robot + " --steps 1000 --held-out 2 --output " +
            (folder / "p.onnx") + " --distribution " + posterior);
  CHECK(trained.status == 0);
  says(trained, "80 % of the episodes are simulated with the residual of " + posterior);

  json other = json::parse(Read(posterior));
  AddInput(&other);
  std::ofstream(folder / "other.json") << other;
  for (const std::string& command :
       {"sim " + robot + " --posterior ", "train " + robot + " --distribution ",
        "excite " + robot + " --posterior "}) {
    const Outcome refused = Shell(Plumb() + command + (folder / "other.json"));
    CHECK(refused.status != 0);
    says(refused, "other.json: residual: the residual is another robot's");
  }

  const Outcome without = calibrate(" --no-residual");
  CHECK(without.status == 0);
  says(without, "what the model lacks is not learnt: residuals are switched off");
  CHECK(Posterior(posterior)["residual"].is_null());
  CHECK(Posterior(posterior)["gap"]["informed"] == "all");
}

TEST_CASE("what cannot be calibrated with is refused in one clear line") {
  const TemporaryFolder folder;
  const auto refused = [&](const std::string& arguments, const std::string& words) {
    const Outcome outcome =
        Shell(Plumb() + "calibrate " + arguments + " --output " + (folder / "x.json"));
    INFO(arguments << ": " << outcome.text);
    CHECK(outcome.status != 0);
    CHECK(outcome.status != -1);
    CHECK(outcome.text.find(words) != std::string::npos);
    CHECK_FALSE(fs::exists(folder / "x.json"));
  };
  const auto write = [&](const std::string& name, const std::string& text) {
    std::ofstream(folder / name) << text;
    return folder / name;
  };
  refused(Robot("pendulum"), "there is no motion");
  refused(Robot("pendulum") + " --csv " + (folder / "missing.csv"), "missing.csv");
  refused(Robot("pendulum") + " --log " + (folder / "missing.lcmlog"), "missing.lcmlog");
  refused(Robot("pendulum") + " --csv " + write("empty.csv", ""), "empty.csv");
  refused(Robot("pendulum") + " --csv " + write("head.csv", "t,q/pivot,v/pivot,u/pivot\n"),
          "head.csv");
  refused(Robot("hopper") + " --csv " +
              write("other.csv", "t,q/pivot,v/pivot,u/pivot\n0,0,0,0\n0.05,0,0,0\n"),
          "other.csv");
  refused(Robot("pendulum") + " --csv " +
              write("one.csv",
                    "t,q/pivot,v/pivot,u/pivot,next_q/pivot,next_v/pivot\n0,1,0,1,1.01,0.4\n"),
          "too few");
  refused(Robot("pendulum") + " --csv " + write("x.csv", "t\n") + " --method laplas", "laplas");
}

TEST_CASE("what is read, or is somebody else's, is not written over") {
  const TemporaryFolder folder;
  const auto write = [&](const std::string& name, const std::string& text) {
    std::ofstream(folder / name) << text;
    return folder / name;
  };
  std::string rows = "t,q/pivot,v/pivot,u/pivot\n";
  for (int i = 0; i < 30; ++i)
    rows += std::to_string(0.05 * i) + ",0.1," + std::to_string(i % 3) + ",1\n";
  const std::string table = write("x.csv", rows), robot = folder / "robot";
  fs::copy(Robot("pendulum"), robot);
  const std::string description = Read(robot + "/robot.toml");
  fs::create_symlink(table, folder / "link.csv");
  const auto refused = [&](const std::string& arguments, const std::string& words) {
    const Outcome outcome = Shell(Plumb() + arguments);
    INFO(arguments << ": " << outcome.text);
    CHECK(outcome.status == 1);
    CHECK(outcome.text.find(words) != std::string::npos);
    CHECK(Read(table) == rows);
    CHECK(Read(robot + "/robot.toml") == description);
  };
  const std::string calibrate = "calibrate " + robot + " --csv " + table + " --output ";
  refused(calibrate + table, "is read, too");
  refused(calibrate + (folder / "link.csv"), "is read, too");
  refused(calibrate + robot + "/robot.urdf", "is read, too");
  refused("sim " + robot + " --csv " + robot + "/robot.toml", "is read, too");
  refused("train " + robot + " --output " + robot + "/robot.toml", "is read, too");
  for (const char* flag : {"--log ", "--can-log ", "--summary "})
    refused("launch " + robot + " --lcm-url memq:// --bus loop: --output " + (folder / "run") +
                " " + flag + robot + "/robot.toml",
            "is read, too");
  refused("launch " + robot + " --lcm-url memq:// --bus loop: --output " + (folder / "run") +
              " --log " + table,
          "is there and not an LCM log");
  write("p.json.journal", "a diary");
  refused(calibrate + (folder / "p.json"), "in the way and no journal");
  CHECK(Read(folder / "p.json.journal") == "a diary");
}

TEST_CASE("names and files cannot control the terminal") {
  const TemporaryFolder folder;
  const std::string file = folder / "a\x1b]0;title\x07z.csv";
  std::ofstream(file) << "t,q/pivot,v/pivot,u/pivot\n0,0,0,x\n";
  const Outcome outcome = Shell(Plumb() + "calibrate " + Robot("pendulum") + " --csv '" + file +
                                "' --output " + (folder / "p.json"));
  INFO(outcome.text);
  CHECK(outcome.status == 1);
  CHECK(outcome.text.find("]0;title") != std::string::npos);
  CHECK(outcome.text.find_first_of("\x1b\x07") == std::string::npos);
}

}  // namespace
}  // namespace plumb
