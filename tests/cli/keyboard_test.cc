#include "cli/keyboard.h"

#include <catch2/catch.hpp>

#include "cli/replay.h"

namespace plumb {
namespace {

TEST_CASE("+ is never slower and - never faster, whatever speed a replay began with") {
  CHECK(Faster(1) == 2);
  CHECK(Faster(40) == 64);
  CHECK(Faster(100) == 100);
  CHECK(Slower(100) == 50);
  CHECK(Slower(1) == 0.5);
  CHECK(Slower(0.02) == 1.0 / 64);
  CHECK(Slower(0.001) == 0.001);
  CHECK(Faster(0.001) == 0.002);
  CHECK(Faster(0) == 0);  // as fast as possible
  CHECK(Slower(0) == 64);
}

TEST_CASE("keys are what terminals send of them, several at once, and nothing else") {
  CHECK(KeysOf("").empty());
  CHECK(KeysOf(" ") == std::vector{Key::kPause});
  CHECK(KeysOf("\x1b[D\x1b[C\x1b[B\x1b[A") ==
        std::vector{Key::kBack, Key::kForth, Key::kFarBack, Key::kFarForth});
  CHECK(KeysOf("\x1bOD+-0\x1b[Hq") == std::vector{Key::kBack, Key::kFaster, Key::kSlower,
                                                  Key::kBeginning, Key::kBeginning, Key::kQuit});
  CHECK(KeysOf("xyz\x1b[5~\x7f\xff\x1b").empty());
}

}  // namespace
}  // namespace plumb
