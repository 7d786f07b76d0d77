#include "calibrator/fit/methods.h"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace plumb {
namespace {

TEST_CASE("docs/inference.md has a row for each method, with the help's words") {
  const std::string file = std::string(std::getenv("PLUMBLINE_SOURCE")) + "/docs/inference.md";
  const std::string docs = (std::stringstream() << std::ifstream(file).rdbuf()).str();
  for (const Method& method : Methods()) {
    CAPTURE(method.name);
    CHECK_THAT(docs, Catch::Contains("| `" + method.name + "` | " + method.help + " |"));
  }
}

TEST_CASE("a method that is none is refused, naming the nearest") {
  CHECK_NOTHROW(RequireMethod("abc-smc"));
  CHECK_THROWS_WITH(RequireMethod("lapalce"),
                    "there is no method 'lapalce'; did you mean 'laplace'?");
}

}  // namespace
}  // namespace plumb
