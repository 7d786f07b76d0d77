// Outputs that are one file: what is written last would be all that is left.
#include "cli/outputs.h"

#include <catch2/catch.hpp>

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
