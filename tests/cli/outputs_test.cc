// Outputs that are one file: what is written last would be all that is left.
#include "cli/outputs.h"

#include <catch2/catch.hpp>

#include "common/config.h"
#include "tests/cli/shell.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

namespace fs = std::filesystem;

TEST_CASE("no two outputs are one file, whatever names it goes by") {
  const TemporaryFolder folder;
  fs::create_directory(folder.path() / "a");
  fs::create_directory_symlink(folder.path() / "a", folder.path() / "b");
  CHECK_NOTHROW(RequireApart({folder / "x", folder / "y", "", ""}));
  for (const char* other : {"a/x", "b/x", "a/../b/./x"}) {
    CHECK_THROWS_WITH(RequireApart({folder / "a/x", folder / other}),
                      Catch::Contains(folder / other + ": would be written twice"));
  }
}

TEST_CASE("what is read is not written, whatever name it goes by") {
  const TemporaryFolder folder;
  const std::string file = folder / "read";
  std::ofstream(file) << "input";
  fs::create_hard_link(file, folder / "hard");
  fs::create_symlink(file, folder / "soft");
  CHECK_NOTHROW(RequireNotRead({folder / "other", ""}, {file, ""}));
  for (const char* other : {"read", "./read", "hard", "soft"})
    CHECK_THROWS_WITH(RequireNotRead({folder / other}, {file}), Catch::Contains("is read, too"));
}

TEST_CASE("only what is of the kind that is to be written is written over") {
  const TemporaryFolder folder;
  const std::string efforts = folder / "efforts.csv", posterior = folder / "posterior.json",
                    page = folder / "mine.html", pendulum = Robot("pendulum"),
                    table = folder / "report.html.csv";
  std::ofstream(efforts) << "t,u/pivot\n0,1\n";
  std::ofstream(posterior) << "{\n \"format\": \"plumbline posterior\"}";
  std::ofstream(page) << "<!DOCTYPE html>\n<html><head><title>Mine";
  std::ofstream(table) << "name,marks\n";
  const std::string endless = folder / "endless.csv";
  {
    std::ofstream rows(endless);
    rows << "t,u/pivot\n";
    for (int k = 0; k < 20'001; ++k) rows << 0.05 * k << ",0\n";
  }
  const std::string launch = "launch " + pendulum + " --bus loop: --output " + (folder / "run");
  for (const auto& [command, words] : std::vector<std::pair<std::string, std::string>>{
           {launch + " --summary " + posterior, "is there and not a run's summary"},
           {launch + " --report " + page, "is there and not a report of ours"},
           {launch + " --log " + page, "is there and not an LCM log"},
           {launch + " --efforts " + efforts + " --summary " + efforts, "is read, too"},
           {launch + " --efforts " + endless, "of one motion 1000 s are kept"},
           {"train " + pendulum + " --output " + (folder / "p.onnx") + " --report " +
                (folder / "report.html"),
            "is there and not a table of a training"}}) {
    const Outcome outcome = Shell(Plumb() + command);
    INFO(command << "\n" << outcome.text);
    CHECK(outcome.status == 1);
    CHECK_THAT(outcome.text, Catch::Contains(words));
  }
}

TEST_CASE("what is read to write from a URDF in another folder is not written over, either") {
  const TemporaryFolder folder;
  fs::copy(Robot("pendulum"), folder / "base");
  fs::create_directory(folder.path() / "own");
  std::ofstream(folder / "own/robot.toml") << "extends = \"../base/robot.toml\"\n";
  const std::vector<std::string> files = FilesOf(LoadRobot(folder / "own"));
  REQUIRE(files.size() == 3);
  CHECK(fs::equivalent(files[2], folder / "base/robot.urdf"));
}

TEST_CASE("launch: a folder that cannot be made is told as every file is") {
  const Outcome outcome =
      Shell(Plumb() + "launch " + Robot("pendulum") + " --bus loop: --output /proc/xx");
  INFO(outcome.text);
  CHECK(outcome.status == 1);
  CHECK_THAT(outcome.text,
             Catch::Contains("/proc/xx: cannot be made: ") && !Catch::Contains("filesystem"));
}

TEST_CASE("a recording that cannot be made again is not written over unasked") {
  const TemporaryFolder folder;
  const std::string log = folder / "run.lcmlog", recorded = "\xed\xa1\xda\x01 and so on";
  const auto beside = [&](const std::string& text) {
    fs::create_directories(log + ".d");
    std::ofstream(log + ".d/record.json") << text;
  };
  CHECK_NOTHROW(RequireOverwritable("", "arm"));
  CHECK_NOTHROW(RequireOverwritable(log, ""));  // there is none
  std::ofstream{log};
  CHECK_NOTHROW(RequireOverwritable(log, ""));
  std::ofstream(log) << recorded;
  const auto refused = [&](const std::string& robot) {
    CHECK_THROWS_WITH(
        RequireOverwritable(log, robot),
        Catch::StartsWith(log + ": holds a recording") && Catch::Contains("--overwrite"));
  };
  refused(""), refused("arm");  // nobody knows what it is
  beside(R"({"robot": "arm", "clock": "real"})");
  refused(""), refused("arm");
  beside(R"({"robot": "arm", "clock": "virtual"})");
  refused(""), refused("hopper");
  CHECK_NOTHROW(RequireOverwritable(log, "arm"));
  beside("no JSON");
  refused("arm");

  const std::string command =
      "launch " + Robot("pendulum") + " --bus loop: --output " + (folder / "run") + " --log " + log;
  const Outcome outcome = Shell(Plumb() + command);
  CHECK(outcome.status == 1);
  CHECK_THAT(outcome.text, Catch::Contains("holds a recording"));
  const Outcome recorder = Shell(Plumb() + "--lcm-url memq:// record " + log);
  CHECK(recorder.status == 1);
  CHECK_THAT(recorder.text, Catch::Contains("holds a recording"));
  CHECK(ReadFile(log) == recorded);
}

TEST_CASE("frames of a real bus are not written over unasked, those of a run in virtual time are") {
  const TemporaryFolder folder;
  const std::string log = folder / "can.log", real = "(1796072996.000000) can0 029#0000\n";
  std::ofstream(log) << real;
  const std::string launch = "launch " + Robot("pendulum") + " --bus loop: --output " +
                             (folder / "run") + " --can-log " + log;
  const Outcome outcome = Shell(Plumb() + launch);
  CHECK(outcome.status == 1);
  CHECK_THAT(outcome.text, Catch::Contains("can.log: is there and not a run's in virtual time"));
  CHECK(ReadFile(log) == real);
  // These come as far as a policy that is not there.
  const auto passes = [&](const std::string& more) {
    const Outcome later = Shell(Plumb() + launch + more + " --policy " + (folder / "none.onnx"));
    CHECK_THAT(later.text, Catch::Contains("none.onnx") && !Catch::Contains("virtual time"));
  };
  passes(" --overwrite");
  std::ofstream(log) << "(1700000001.250000) can0 029#0000\n";
  passes("");
}

TEST_CASE("an option that would have no effect is refused") {
  for (const auto& [command, words] : std::map<std::string, std::string>{
           {"sim " + Robot("pendulum") + " --noise 0.1", "--noise requires --csv"},
           {"train " + Robot("pendulum") + " --evaluate-every 1", "needs --csv or --report"},
           {"export a.lcmlog --csv a --robot b", "--robot requires --mcap"},
           {"export-model a --urdf b --samples 3", "--samples requires --randomisation"},
           {"export-model a --urdf b --seed 3", "--seed requires --randomisation"},
           {"launch " + Robot("pendulum") + " --overwrite", "needs --log or --can-log"}}) {
    const Outcome outcome = Shell(Plumb() + command);
    INFO(command << "\n" << outcome.text);
    CHECK(outcome.status == 2);
    CHECK_THAT(outcome.text, Catch::Contains(words));
  }
}

TEST_CASE("commands refuse to write two outputs into one file, before anything is computed") {
  const TemporaryFolder folder;
  const std::string file = folder / "same", again = folder / "./same", pendulum = Robot("pendulum");
  for (const std::string& command :
       {"calibrate " + pendulum + " --csv none.csv --output " + file + " --report " + again,
        "calibrate " + pendulum + " --csv none.csv --output " + file + " --urdf " + again +
            ".journal",
        "train " + pendulum + " --output " + file + " --csv " + again,
        "train " + pendulum + " --output " + file + " --report " + again + ".checkpoint",
        "excite " + pendulum + " --output " + file + " --png " + again,
        "sim " + pendulum + " --csv " + file + " --gif " + again,
        "launch " + pendulum + " --bus loop: --output " + (folder / "run") + " --log " + file +
            " --report " + again}) {
    const Outcome outcome = Shell(Plumb() + command);
    INFO(command << "\n" << outcome.text);
    CHECK(outcome.status == 1);
    CHECK(outcome.text.find("would be written twice") != std::string::npos);
    CHECK_FALSE(fs::exists(file));
  }
}

}  // namespace
}  // namespace plumb
