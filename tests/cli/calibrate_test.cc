// `plumb calibrate`, run as a person would.
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/cli/shell.h"
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

std::string HopperTable(const TemporaryFolder& folder) {
  const std::string file = folder / "hopper.csv";
  REQUIRE(Shell(Plumb() + "sim " + Robot("hopper") +
                " --random --episodes 20 --seed 3 --set mass/torso=3.6 mass/thigh=4.1 "
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
    "a calibration that was killed at any time goes on to the same bits, with any number of "
    "threads") {
  const TemporaryFolder folder;
  const std::string table = HopperTable(folder);
  const std::string command = Plumb() + "calibrate " + Robot("hopper") + " --csv " + table +
                              " --method reps --budget 200000 --output ";
  REQUIRE(Shell(command + (folder / "whole.json") + " --threads 1").status == 0);
  const json whole = Posterior(folder / "whole.json");
  // Killed by the system when its journal has grown so far, within a record or not.
  int killed = 0;
  for (const int blocks : {1, 600, 1800, 3600, 6000}) {
    const Outcome outcome =
        Shell("ulimit -c 0; ulimit -f " + std::to_string(blocks) + "; exec " + command +
              (folder / "killed.json") + " --threads " + std::to_string(1 + killed % 2));
    INFO(outcome.text);
    REQUIRE(outcome.status == -1);
    ++killed;
  }
  const Outcome last = Shell(command + (folder / "killed.json") + " --threads 2");
  REQUIRE(last.status == 0);
  CHECK(last.text.find("went on from") != std::string::npos);
  CHECK(Posterior(folder / "killed.json") == whole);
}

TEST_CASE("ranks that share the work come to the same bits") {
  if (Shell("command -v mpirun").status != 0) {
    WARN("skipped: mpirun (openmpi-bin) is not installed");
    return;
  }
  const TemporaryFolder folder;
  const std::string table = HopperTable(folder);
  const std::string arguments =
      "calibrate " + Robot("hopper") + " --csv " + table + " --threads 1 --output ";
  REQUIRE(Shell(Plumb() + arguments + (folder / "one.json")).status == 0);
  const Outcome three = Shell(
      "OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 mpirun --oversubscribe -n 3 " +
      Plumb() + arguments + (folder / "three.json"));
  INFO(three.text);
  REQUIRE(three.status == 0);
  CHECK(Posterior(folder / "three.json") == Posterior(folder / "one.json"));
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
  refused(Robot("pendulum"), "there is nothing to calibrate with");
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

}  // namespace
}  // namespace plumb
