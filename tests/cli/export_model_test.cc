// `plumb export-model`, run as a person would.
#include <catch2/catch.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/cli/shell.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

using Catch::Contains;
using nlohmann::json;

std::string ExportModel(const std::string& robot) {
  return Plumb() + "export-model " + Robot(robot) + " ";
}

}  // namespace

TEST_CASE("plumb export-model writes what a calibration has found, the same bytes each time") {
  const TemporaryFolder folder;
  const std::string table = folder / "motion.csv", posterior = folder / "posterior.json";
  REQUIRE(Shell(Plumb() + "sim " + Robot("hopper") +
                " --random --episodes 20 --seed 3 --set mass/torso=3.25 --csv " + table)
              .status == 0);
  REQUIRE(
      Shell(Plumb() + "calibrate " + Robot("hopper") + " --csv " + table + " --output " + posterior)
          .status == 0);
  const auto write = [&](const std::string& name) {
    const Outcome outcome =
        Shell(ExportModel("hopper") + "--posterior " + posterior + " --mjcf " +
              (folder / name + ".xml") + " --urdf " + (folder / name + ".urdf") +
              " --randomisation " + (folder / name + ".json") + " --samples 20 --seed 4");
    INFO(outcome.text);
    REQUIRE(outcome.status == 0);
  };
  write("one");
  write("two");
  for (const char* kind : {".xml", ".urdf", ".json"})
    CHECK(Read(folder / ("one" + std::string(kind))) == Read(folder / ("two" + std::string(kind))));
  const json randomisation = json::parse(Read(folder / "one.json"));
  CHECK(randomisation["source"] == posterior);
  CHECK(randomisation["seed"] == 4);
  CHECK(randomisation["samples"].size() == 20);
  CHECK(randomisation["names"][0] == "mass/torso");
  CHECK(randomisation["mean"][0].get<double>() == Approx(3.25).epsilon(1e-6));
  CHECK_THAT(Read(folder / "one.xml"), Contains("mass/torso = 3.25 kg"));
  CHECK_THAT(Read(folder / "one.urdf"), Contains("mass/torso = 3.25 kg"));

  // Another robot's.
  const Outcome other =
      Shell(ExportModel("pendulum") + "--posterior " + posterior + " --mjcf " + (folder / "p.xml"));
  CHECK(other.status == 1);
  CHECK_THAT(other.text, Contains("posterior.json"));
  CHECK_FALSE(std::filesystem::exists(folder / "p.xml"));
}

TEST_CASE("plumb export-model says what is wrong in a line") {
  const TemporaryFolder folder;
  const Outcome nothing = Shell(ExportModel("pendulum"));
  CHECK(nothing.status == 1);
  CHECK_THAT(nothing.text, Contains("--mjcf"));
  const Outcome over = Shell(ExportModel("pendulum") + "--urdf " + Robot("pendulum/robot.urdf"));
  CHECK(over.status == 1);
  CHECK_THAT(over.text, Contains("is read, too"));
  const Outcome none =
      Shell(ExportModel("pendulum") + "--mjcf " + (folder / "no folder/pendulum.xml"));
  CHECK(none.status == 2);
  CHECK_THAT(none.text, Contains("pendulum.xml"));
}

}  // namespace plumb
