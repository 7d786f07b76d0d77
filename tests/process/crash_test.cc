// kill -9 at points that are the run's own (so many bytes of a journal, so many lines of a table, a
// file that has come to be), and files that find no more room: the same command goes on to the same
// bits. bench/kills does it at random moments.

#include <unistd.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/process/launch.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Catch::Contains;
using nlohmann::json;

/// A command, and the folder that it leaves its files in.
struct Command {
  Stage& stage;
  std::string program;
  std::vector<std::string> arguments;
  fs::path folder;

  Child Start(const std::vector<std::string>& wrapped = {}) const {
    fs::create_directories(folder);
    std::vector<std::string> line = wrapped;
    line.push_back(Stage::Binary(program));
    line.insert(line.end(), arguments.begin(), arguments.end());
    fs::remove(log());
    return Child(program, line, log());
  }
  std::string Finish() const {
    Child child = Start();
    REQUIRE(child.WaitFor(kLong));
    INFO(child.Tail(20));
    REQUIRE_FALSE(child.failed());
    return child.Tail(100);
  }
  void KillWhen(const std::function<bool()>& so) const {
    Child child = Start();
    REQUIRE(AwaitReally([&] { return so() || !child.running(); }));
    INFO(child.Tail(20));
    REQUIRE(child.running());
    child.Signal(SIGKILL);
    REQUIRE(child.WaitFor(kLong));
    CHECK(child.ending() == "killed by signal 9");
    CHECK(AwaitReally([&] { return OfTheRun() == 0; }));
  }
  /// No file may have more than so many blocks of 512 bytes, nor may its log: one at least.
  /// @return what it says.
  std::string Cramped(int blocks) const {
    Child child =
        Start({"sh", "-c", "ulimit -f " + std::to_string(blocks) + "; exec \"$@\"", "sh"});
    REQUIRE(child.WaitFor(kLong));
    CHECK(child.ending() == "exit status 1");
    CHECK(OfTheRun() == 0);
    return child.Tail(100);
  }
  fs::path log() const { return folder.string() + ".log"; }

 private:
  int OfTheRun() const {
    int left = 0;
    for (const auto& entry : fs::directory_iterator("/proc"))
      left += Read(entry.path() / "cmdline").find(folder.string() + "/") != std::string::npos;
    return left;
  }
};

int64_t Size(const fs::path& file) {
  std::error_code not_there;
  const auto size = fs::file_size(file, not_there);
  return not_there ? 0 : static_cast<int64_t>(size);
}

int64_t Lines(const fs::path& file) { return std::ranges::count(Read(file), '\n'); }

/// One line names the file and says why.
void IsOneLine(const std::string& said, const std::string& file) {
  INFO(said);
  const std::string why = "cannot be written: File too large";
  CHECK_THAT(said, Contains(file + ": " + why));
  CHECK(said.find(why) == said.rfind(why));
}

TEST_CASE("plumb calibrate goes on to the same bits") {
  Stage stage(100);
  const std::string table = stage.folder / "table.csv";
  Command{stage,
          "plumb",
          {"sim", Stage::Environment("PLUMBLINE_SOURCE", ".") + "/robots/hopper", "--random",
           "--episodes", "6", "--seed", "3", "--csv", table},
          stage.folder / "sim"}
      .Finish();
  const auto calibrate = [&](const std::string& name) {
    const fs::path folder = stage.folder / name;
    return Command{stage,
                   "plumb",
                   {"calibrate", Stage::Environment("PLUMBLINE_SOURCE", ".") + "/robots/hopper",
                    "--csv", table, "--method", "reps", "--budget", "30000", "--output",
                    folder / "p.json", "--urdf", folder / "identified.urdf"},
                   folder};
  };
  const auto traces = [&](const Command& command) {
    json posterior = json::parse(Read(command.folder / "p.json"));
    posterior.erase("run");  // the date and the command
    CHECK_FALSE(fs::exists(command.folder / "p.json.journal"));
    return posterior.dump() + Read(command.folder / "identified.urdf");
  };
  const Command whole = calibrate("whole"), broken = calibrate("broken");
  whole.Finish();
  const fs::path journal = broken.folder / "p.json.journal";
  SECTION("killed") {
    for (const int64_t bytes : {1, 40'000, 120'000})
      broken.KillWhen([&] { return Size(journal) >= bytes; });
  }
  SECTION("without room") {
    for (const int blocks : {2, 33, 150}) IsOneLine(broken.Cramped(blocks), journal);
  }
  broken.Finish();
  CHECK(traces(broken) == traces(whole));
}

TEST_CASE("plumb train goes on to the same bits") {
  Stage stage(101);
  const auto train = [&](const std::string& name) {
    const fs::path folder = stage.folder / name;
    return Command{stage,
                   "plumb",
                   {"train", stage.robot_folder, "--steps", "24000", "--held-out", "5", "--output",
                    folder / "p.onnx", "--csv", folder / "p.csv"},
                   folder};
  };
  const auto traces = [&](const Command& command) {
    std::string all = Read(command.folder / "p.onnx") + Read(command.folder / "p.onnx.checkpoint");
    REQUIRE_FALSE(all.empty());
    std::istringstream table(Read(command.folder / "p.csv"));
    for (std::string line; std::getline(table, line);)
      all += line.substr(0, line.rfind(',')) + "\n";  // the last column is the time
    return all;
  };
  const Command whole = train("whole"), broken = train("broken");
  whole.Finish();
  const fs::path table = broken.folder / "p.csv", checkpoint = broken.folder / "p.onnx.checkpoint";
  const auto interrupt_at = [&](int64_t lines) {  // and so with a checkpoint
    Child child = broken.Start();
    REQUIRE(AwaitReally([&] { return Lines(table) >= lines || !child.running(); }));
    child.Signal(SIGINT);
    REQUIRE(child.WaitFor(kLong));
    CHECK(child.ending() == "exit status 130");
  };
  SECTION("killed before the first checkpoint, and beyond one") {
    broken.KillWhen([&] { return Lines(table) >= 3; });
    interrupt_at(4);
    broken.KillWhen([&] { return Lines(table) >= 8; });
  }
  SECTION("without room for a checkpoint, and for the policy") {
    interrupt_at(4);
    const std::string before = Read(checkpoint);
    const auto policy = static_cast<int>(Size(whole.folder / "p.onnx") / 512);
    REQUIRE(Size(checkpoint) > 512 * (policy + 2));
    IsOneLine(broken.Cramped(policy + 2), checkpoint);
    CHECK(Read(checkpoint) == before);  // the old one, whole
    broken.Finish();
    fs::remove(broken.folder / "p.onnx");
    IsOneLine(broken.Cramped(policy - 1), broken.folder / "p.onnx");
    CHECK_FALSE(fs::exists(broken.folder / "p.onnx"));
  }
  broken.Finish();
  CHECK(traces(broken) == traces(whole));
}

TEST_CASE(
    "a launch in virtual time begins anew, trains no more than is left, and comes to the same "
    "bits") {
  Stage stage(103);
  LearnLittle(stage);
  const auto launch = [&](const std::string& name, const std::string& iterations = "2") {
    const fs::path folder = stage.folder / name;
    return Command{stage,
                   "plumb",
                   {"launch",
                    stage.robot_folder,
                    "--lcm-url",
                    "memq://",
                    "--bus",
                    "loop:",
                    "--seed",
                    "3",
                    "--iterations",
                    iterations,
                    "--evaluation-episodes",
                    "1",
                    "--output",
                    folder / "run",
                    "--log",
                    folder / "run.lcmlog",
                    "--can-log",
                    folder / "run.can",
                    "--summary",
                    folder / "summary.json"},
                   folder};
  };
  const auto traces = [&](const Command& command) {
    std::map<std::string, std::string> all;
    for (const char* file :
         {"run.lcmlog", "run.can", "summary.json", "run/calibration/calibration.checkpoint",
          "run/calibration/rollout_3.checkpoint", "run/calibration/posterior_1.json",
          "run/calibration/posterior_2.json", "run/training/trainer.checkpoint"}) {
      INFO(file);
      all[file] = Read(command.folder / file);
      REQUIRE_FALSE(all[file].empty());
    }
    return all;
  };
  const auto same = [&](const Command& one, const Command& other) {
    const auto expected = traces(one), found = traces(other);
    for (const auto& [file, bytes] : expected) {
      INFO(file);
      CHECK((found.at(file) == bytes));  // not to be printed
    }
  };
  const Command whole = launch("whole"), broken = launch("broken");
  whole.Finish();
  const fs::path training = broken.folder / "run/training",
                 calibration = broken.folder / "run/calibration";
  SECTION("killed") {
    broken.KillWhen([&] { return fs::exists(training / "trainer_0.checkpoint"); });
    broken.KillWhen([&] { return fs::exists(calibration / "posterior_1.json"); });
    broken.KillWhen([&] { return fs::exists(training / "trainer_1.checkpoint"); });
  }
  SECTION("without room for its record") {
    const std::string said = broken.Cramped(2000);
    INFO(said);
    CHECK_THAT(said, Contains("cannot be written: File too large"));
    CHECK(said.find("cannot be written") == said.rfind("cannot be written"));
  }
  SECTION("from one with fewer iterations") { launch("broken", "1").Finish(); }
  broken.Finish();
  same(whole, broken);
}

TEST_CASE("an experiment goes on to the same bits") {
  Stage stage(102);
  const auto compare = [&](const std::string& name) {
    const fs::path folder = stage.folder / name;
    return Command{stage,
                   "plumb-reality-gap",
                   {Stage::Environment("PLUMBLINE_SOURCE", ".") + "/robots", "--quick", "--runs",
                    "2", "--iterations", "1", "--gaps", "pendulum", "--methods",
                    "default,acceptance", "--output", folder / "gap"},
                   folder};
  };
  const auto traces = [&](const Command& command) {
    std::string all;
    for (const char* file :
         {"reality_gap.csv", "reality_gap.svg", "decisions_pendulum_default_1.txt",
          "decisions_pendulum_default_2.txt", "decisions_pendulum_acceptance_1.txt"}) {
      const std::string trace = Read(command.folder / "gap" / file);
      INFO(file);
      REQUIRE_FALSE(trace.empty());
      all += trace;
    }
    return all;
  };
  const Command whole = compare("whole"), broken = compare("broken");
  whole.Finish();
  const fs::path table = broken.folder / "gap/reality_gap.csv";
  SECTION("killed when the table has so many lines") {
    for (const int64_t lines : {4, 6}) broken.KillWhen([&] { return Lines(table) >= lines; });
  }
  SECTION("without room for the table") { IsOneLine(broken.Cramped(1), "reality_gap.csv"); }
  broken.Finish();
  CHECK(traces(broken) == traces(whole));
}

}  // namespace
}  // namespace plumb
