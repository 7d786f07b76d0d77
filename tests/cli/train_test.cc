// plumb train as people run it: interrupted and resumed, with any number of threads, and given
// nonsense.

#include <catch2/catch.hpp>
#include <cmath>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>
#include <thread>

#include "tests/cli/shell.h"
#include "tests/mpirun.h"
#include "tests/temporary_folder.h"
#include "trainer/checkpoint.h"
#include "trainer/onnx_policy.h"

namespace plumb {
namespace {

std::string Train(const TemporaryFolder& folder, const std::string& name,
                  const std::string& flags) {
  return Plumb() + "train " + Robot("pendulum") + " --held-out 5 --output " + folder / name +
         " --csv " + folder / (name + ".csv") + " " + flags;
}

// All columns but the last, which is the time.
std::vector<std::string> Rows(const std::string& file) {
  std::istringstream text(Read(file));
  std::vector<std::string> rows;
  for (std::string line; std::getline(text, line);) rows.push_back(line.substr(0, line.rfind(',')));
  return rows;
}

TEST_CASE("train writes a policy, a table and what to expect of it") {
  const TemporaryFolder folder;
  const Outcome outcome =
      Shell(Train(folder, "policy.onnx", "--steps 6400 --evaluate-every 2 --distribution nominal"));
  INFO(outcome.text);
  REQUIRE(outcome.status == 0);
  CHECK(outcome.text.find("6400 steps, 4 updates") != std::string::npos);
  CHECK(std::regex_search(
      outcome.text,
      std::regex("nominal +-[0-9.]+ mean, -[0-9.]+ 10th percentile, -[0-9.]+ worst")));
  CHECK(std::regex_search(outcome.text, std::regex("prior +-[0-9.]+ mean")));
  CHECK(std::regex_search(
      outcome.text, std::regex("return -[0-9]+.*KL 0.*gain.*explained.*entropy.*steps/s.*left")));
  CHECK(outcome.text.find("wrote " + folder / "policy.onnx") != std::string::npos);
  const OnnxPolicy written = ReadOnnxPolicy(folder / "policy.onnx");
  const Checkpoint checkpoint = *LoadCheckpoint(folder / "policy.onnx.checkpoint");
  CHECK(checkpoint.complete);
  CHECK(checkpoint.judged);
  const bool last = outcome.text.find("; policy of update 4\n") != std::string::npos;
  CHECK(written.policy.ToMessage().weight ==
        (last ? checkpoint.policy : checkpoint.best_policy).weight);
  if (!last) {
    CHECK(outcome.text.find("; policy of update " + std::to_string(checkpoint.best_updates)) !=
          std::string::npos);
  }
  CHECK(written.record.robot == "pendulum");
  CHECK(written.record.posterior == "nominal");
  CHECK(written.record.steps == 6400);
  CHECK(written.record.evaluation.at("simulators") == 5);
  CHECK(written.record.evaluation.at("worst") <= written.record.evaluation.at("mean"));
  CHECK(
      Shell(Plumb() + "sim " + Robot("pendulum") + " --policy " + folder / "policy.onnx").status ==
      0);
  const auto rows = Rows(folder / "policy.onnx.csv");
  REQUIRE(rows.size() == 5);
  CHECK(rows[0] ==
        "update,steps,mean_return,evaluation_return,kl,surrogate_gain,explained_variance,entropy,"
        "accepted,dropped_episodes");
  CHECK(rows[1].find("1,1600,-") == 0);
  CHECK(rows[1].find(",nan,") != std::string::npos);
  CHECK(rows[2].find(",nan,") == std::string::npos);
}

TEST_CASE("a report has the table's curves and the run's numbers, and loads nothing") {
  const TemporaryFolder folder;
  const std::string report = folder / "training.html";
  const Outcome outcome = Shell(Plumb() + "train " + Robot("pendulum") +
                                " --held-out 5 --steps 6400 --evaluate-every 2 --output " +
                                folder / "policy.onnx" + " --report " + report);
  INFO(outcome.text);
  REQUIRE(outcome.status == 0);
  CHECK(outcome.text.find("wrote " + folder / "policy.onnx" + ", " + report + ", " + report +
                          ".csv") != std::string::npos);
  CHECK(Rows(report + ".csv").size() == 5);
  const std::string page = Read(report);
  const auto has = [&](const std::string& text) { return page.find(text) != std::string::npos; };
  CHECK(has("<h1>Training of pendulum</h1>"));
  CHECK(has("4 updates, 6400 simulated steps"));
  CHECK(has("train " + Robot("pendulum")));  // the command
  std::smatch mean;
  REQUIRE(std::regex_search(outcome.text, mean, std::regex("prior +(-[0-9]+)")));
  CHECK(has("mean " + mean[1].str()));
  for (const char* curve : {"return", "KL [nat]", "gain", "explained", "entropy [nat]"})
    CHECK(has("<title>" + std::string(curve) + "</title>"));
  CHECK(has("gravity"));
  CHECK(has("--posterior: light-dark("));  // the live page's colours
  CHECK_FALSE(std::regex_search(page, std::regex("(src|href)=|url\\(|@import")));
  // Two evaluations on the way are two dots.
  const std::regex dot("posterior mark");
  CHECK(std::distance(std::sregex_iterator(page.begin(), page.end(), dot), {}) == 2);
}

TEST_CASE("a training that has ended is reported without its curves, if its table was not kept") {
  const TemporaryFolder folder;
  const std::string command = Plumb() + "train " + Robot("pendulum") +
                              " --held-out 5 --steps 3200 --output " + folder / "policy.onnx",
                    report = folder / "training.html";
  REQUIRE(Shell(command).status == 0);
  const std::string policy = Read(folder / "policy.onnx");
  const Outcome outcome = Shell(command + " --report " + report);
  INFO(outcome.text);
  CHECK(outcome.status == 0);
  CHECK(Read(folder / "policy.onnx") == policy);
  const std::string page = Read(report);
  CHECK(page.find("2 updates, 3200 simulated steps") != std::string::npos);
  CHECK(page.find("There are no curves") != std::string::npos);
  CHECK(page.find("<svg") == std::string::npos);
}

TEST_CASE("the paper's way is another training, also of a robot with the paper's settings") {
  const TemporaryFolder folder;
  const std::string robot = folder / "pendulum/paper.toml";
  REQUIRE(Shell("cp -r " + Robot("pendulum") + " " + folder.path().string()).status == 0);
  std::ofstream(robot)
      << "extends = \"robot.toml\"\n[training]\nnormalise_values = false\nfisher_fraction = 1.0\n"
      << "batch = 3000\ngamma = 0.995\nlambda = 0.97\nkl = 0.01\n"
      << "critic_epochs = 20\n";
  const std::string command =
      Plumb() + "train " + robot + " --held-out 5 --steps 6000 --output " + folder / "policy.onnx";
  REQUIRE(Shell(command + " --paper").status == 0);
  CHECK_THAT(Shell(command).text, Catch::Contains("is of another run, which has ended"));
}

TEST_CASE("an interrupted training goes on to the same bits, with any number of threads") {
  const TemporaryFolder folder;
  REQUIRE(Shell(Train(folder, "straight", "--steps 24000 --threads 1")).status == 0);
  int runs = 0;
  for (int status = 130; status != 0; ++runs) {  // 15 updates, and one at least each time
    REQUIRE(runs <= 15);
    const std::string threads = runs % 2 == 0 ? "1" : "2";
    const Outcome outcome =
        Shell("exec " + Train(folder, "resumed", "--steps 24000 --threads " + threads), " KL ");
    INFO(outcome.text);
    status = outcome.status;
    REQUIRE((status == 0 || status == 130));
  }
  CHECK(runs > 1);
  CHECK(Rows(folder / "resumed.csv") == Rows(folder / "straight.csv"));
  const auto straight = LoadCheckpoint(folder / "straight.checkpoint"),
             resumed = LoadCheckpoint(folder / "resumed.checkpoint");
  REQUIRE(straight);
  REQUIRE(resumed);
  CHECK(resumed->policy.weight == straight->policy.weight);
  CHECK(Read(folder / "resumed") == Read(folder / "straight"));
  CHECK(resumed->critic.second_moment == straight->critic.second_moment);
  SECTION("and further, if asked for more steps") {
    REQUIRE(Shell(Train(folder, "resumed", "--steps 32000")).status == 0);
    REQUIRE(Shell(Train(folder, "long", "--steps 32000")).status == 0);
    CHECK(LoadCheckpoint(folder / "resumed.checkpoint")->policy.weight ==
          LoadCheckpoint(folder / "long.checkpoint")->policy.weight);
  }
  SECTION("but another run begins anew, as if there were none") {
    const Outcome outcome = Shell(Train(folder, "resumed", "--steps 6000 --seed 2"));
    INFO(outcome.text);
    CHECK(outcome.status == 0);
    CHECK(outcome.text.find("resumed.checkpoint is of another run, which has ended: begins anew") !=
          std::string::npos);
    REQUIRE(Shell(Train(folder, "other", "--steps 6000 --seed 2")).status == 0);
    CHECK(Read(folder / "resumed") == Read(folder / "other"));
    CHECK(Rows(folder / "resumed.csv") == Rows(folder / "other.csv"));
    CHECK(Read(folder / "resumed.checkpoint") == Read(folder / "other.checkpoint"));
  }
}

TEST_CASE("a training that is interrupted while its policy is judged is not lost") {
  const TemporaryFolder folder;
  const std::string checkpoint = folder / "p.checkpoint";
  // It appears when all has been learnt.
  const Outcome interrupted = Shell(
      Plumb() + "train " + Robot("pendulum") + " --steps 1600 --held-out 1000000 --output " +
      folder / "p" + " & until [ -e " + checkpoint + " ]; do sleep 0.01; done; kill $!; wait $!");
  INFO(interrupted.text);
  CHECK(interrupted.status == 130);
  const Outcome again = Shell(Train(folder, "p", "--steps 1600"));
  CHECK(again.status == 0);
  CHECK(again.text.find("goes on from " + checkpoint + ": update 1,") != std::string::npos);
  REQUIRE(Shell(Train(folder, "straight", "--steps 1600")).status == 0);
  CHECK(Read(folder / "p") == Read(folder / "straight"));
  CHECK(Read(checkpoint) == Read(folder / "straight.checkpoint"));
}

TEST_CASE("a training that has not ended is not lost to another one") {
  const TemporaryFolder folder;
  REQUIRE(Shell("exec " + Train(folder, "half", "--steps 1e8"), " KL ").status == 130);
  const std::string checkpoint = Read(folder / "half.checkpoint"),
                    table = Read(folder / "half.csv");
  const Outcome outcome = Shell(Train(folder, "half", "--steps 6000 --seed 2"));
  INFO(outcome.text);
  CHECK(outcome.status == 1);
  CHECK(outcome.text.find("is of another run") != std::string::npos);
  CHECK(outcome.text.find("has not ended: delete it, or give another --checkpoint") !=
        std::string::npos);
  CHECK(Read(folder / "half.checkpoint") == checkpoint);
  CHECK(Read(folder / "half.csv") == table);
  CHECK_FALSE(std::filesystem::exists(folder / "half"));
}

TEST_CASE("ranks give the same bits as one process, file by file") {
  const TemporaryFolder folder;
  REQUIRE(Shell(Train(folder, "one", "--steps 12000 --threads 2")).status == 0);
  if (!HaveMpirun()) return;
  const Outcome begun = Shell(Mpirun(3, Train(folder, "three", "--steps 6000 --threads 1")));
  INFO(begun.text);
  REQUIRE(begun.status == 0);
  // from its checkpoint
  const Outcome outcome = Shell(Mpirun(3, Train(folder, "three", "--steps 12000 --threads 1")));
  INFO(outcome.text);
  REQUIRE(outcome.status == 0);
  CHECK(Read(folder / "three") == Read(folder / "one"));
  CHECK(Rows(folder / "three.csv") == Rows(folder / "one.csv"));
  CHECK(Read(folder / "three.checkpoint") == Read(folder / "one.checkpoint"));
}

TEST_CASE("the paper's settings are another run, and so is a guarded one") {
  const TemporaryFolder folder;
  for (const std::string flags :
       {"--steps 6000", "--steps 6000 --paper", "--steps 6000 --worst-share 0.5 --worst-after 1"}) {
    const std::string name = "p" + std::to_string(flags.size());
    const Outcome outcome = Shell(Train(folder, name, flags));
    INFO(outcome.text);
    REQUIRE(outcome.status == 0);
  }
  const auto weights = [&](const std::string& name) {
    return LoadCheckpoint(folder / name + ".checkpoint")->policy.weight;
  };
  CHECK(weights("p12") != weights("p20"));
  CHECK(weights("p12") != weights("p46"));
}

TEST_CASE("a policy to begin with") {
  const TemporaryFolder folder;
  REQUIRE(Shell(Train(folder, "first", "--steps 15000")).status == 0);
  const Outcome outcome =
      Shell(Train(folder, "second", "--steps 3000 --seed 2 --from " + folder / "first"));
  INFO(outcome.text);
  REQUIRE(outcome.status == 0);
  const auto first = LoadCheckpoint(folder / "first.checkpoint")->policy,
             second = LoadCheckpoint(folder / "second.checkpoint")->policy;
  double moved = 0, size = 0;
  for (size_t i = 0; i < first.weight.size(); ++i) {
    moved += std::pow(second.weight[i] - first.weight[i], 2);
    size += std::pow(first.weight[i], 2);
  }
  CHECK(moved > 0);
  CHECK(moved < 0.01 * size);
}

TEST_CASE("nonsense is refused with a line that says why") {
  const TemporaryFolder folder;
  const auto refused = [&](const std::string& flags, const std::string& why) {
    const Outcome outcome = Shell(Train(folder, "policy", flags));
    INFO(flags << ": " << outcome.text);
    CHECK(outcome.status != 0);
    CHECK(outcome.status != -1);
    CHECK(outcome.text.find(why) != std::string::npos);
    CHECK_FALSE(std::filesystem::exists(folder / "policy"));
  };
  refused("--steps 3000 --distribution " + folder / "none.json", "none.json");
  refused("--steps -5", "--steps");
  refused("--steps 3000 --worst-share 0", "--worst-share");
  refused("--steps 3000 --from " + folder / "none.onnx", "none.onnx");
  refused("--steps 3000 --checkpoint /proc/no/such", "/proc/no/such");
  const std::string large = folder / "large.toml";
  std::ofstream(large) << "extends = \"" + Robot("pendulum") + "/robot.toml\"\n[robot]\nurdf = \"" +
                              Robot("pendulum") +
                              "/robot.urdf\"\n[training]\nhidden = [1100, 1000]\n";
  const Outcome outcome = Shell(Plumb() + "train " + large + " --output /proc/no/such");
  CHECK(outcome.status == 1);
  CHECK(outcome.text.find("gets through to nobody") != std::string::npos);
  std::ofstream(folder / "text.json") << "{\"parameters\": 7}";
  refused("--steps 3000 --distribution " + folder / "text.json", "text.json");
  std::ofstream(folder / "arm.csv") << "t,u/pivot\n";
  refused("--steps 3000 --distribution " + folder / "arm.csv",
          "/arm.csv: is no posterior.json: parse error at line 1, column 2: ");
  std::ofstream(folder / "policy.checkpoint") << "rubbish";
  refused("--steps 3000", "policy.checkpoint is not a trainer's checkpoint");
}

}  // namespace
}  // namespace plumb
