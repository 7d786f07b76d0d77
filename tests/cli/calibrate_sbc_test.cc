// `plumb calibrate --sbc`, and flags that would have no effect with it or with --model.
#include <catch2/catch.hpp>
#include <string>

#include "tests/cli/shell.h"
#include "tests/mpirun.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

TEST_CASE("a flag that would have no effect is refused") {
  const std::string calibrate = Plumb() + "calibrate " + Robot("pendulum") + " --csv a.csv ";
  for (const char* flag : {"--budget 1e4", "--discrepancy mmd", "--horizons 1", "--method reps",
                           "--no-residual", "--replay", "--report r.html"}) {
    for (const char* way : {"--sbc 20 ", "--model http://127.0.0.1:1 "}) {
      const Outcome outcome = Shell(calibrate + way + flag);
      INFO(way << flag << ": " << outcome.text);
      CHECK(outcome.status == 2);
      CHECK(outcome.text.find(std::string(flag).substr(0, std::string(flag).find(' '))) !=
            std::string::npos);
    }
  }
  for (const char* flags :
       {"--sbc 20 --output p.json", "--sbc 20 --urdf u.urdf", "--sbc 20 --model http://127.0.0.1:1",
        "--model http://127.0.0.1:1 --strict", "--model http://127.0.0.1:1 --threads 2"})
    CHECK(Shell(calibrate + flags).status == 2);
}

TEST_CASE(
    "simulation-based calibration says whether posteriors are right, or that it cannot tell") {
  const TemporaryFolder folder;
  const std::string robot = Robot("pendulum/gym.toml"), table = folder / "a.csv";
  REQUIRE(Shell(Plumb() + "sim " + robot + " --random --episodes 3 --seed 3 --noise 0.001 --csv " +
                table)
              .status == 0);
  const std::string calibrate = "calibrate " + robot + " --csv " + table + " --strict --sbc ";
  const Outcome few = Shell(Plumb() + calibrate + "5"), enough = Shell(Plumb() + calibrate + "20");
  INFO(few.text << enough.text);
  CHECK(few.status == 3);
  CHECK(few.text.find("5 posteriors are too few to tell") != std::string::npos);
  CHECK(few.text.find("calibrated") == std::string::npos);
  CHECK(enough.status == 0);
  CHECK(enough.text.find("calibrated") != std::string::npos);
  CHECK(enough.text.find("unknown") == std::string::npos);
  if (!HaveMpirun()) return;
  const Outcome ranks = Shell(Mpirun(2, Plumb() + calibrate + "5"));
  INFO(ranks.text);
  CHECK(ranks.status == 1);
  const std::string refusal = "--model and --sbc are for one rank";
  REQUIRE(ranks.text.find(refusal) != std::string::npos);
  CHECK(ranks.text.find(refusal) == ranks.text.rfind(refusal));
}

}  // namespace
}  // namespace plumb
