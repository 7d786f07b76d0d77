#include "cli/keyboard.h"

#include <catch2/catch.hpp>

namespace plumb {
namespace {

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
