#include "robot/json_text.h"

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

namespace plumb {
namespace {

TEST_CASE("JSON is read, unless its numbers or its depth are nobody's") {
  CHECK(ParseJson(R"({"a": [1, -2.5e-300, "[[[ \\\" 1"]})")["a"][1] == -2.5e-300);
  CHECK_THROWS_WITH(ParseJson("{\"a\": " + std::string(1'000'000, '7') + "}"),
                    Catch::Contains("a number of more than 100 digits"));
  CHECK_THROWS_WITH(ParseJson(std::string(200'000, '[')), Catch::Contains("nests deeper than 100"));
  CHECK_NOTHROW(ParseJson("\"" + std::string(1'000'000, '7') + "\""));
  CHECK_THROWS_WITH(ParseJson("{\"a"), Catch::StartsWith("parse error at line 1, column 4: "));
  CHECK_THROWS_WITH(ParseJson("[1e999]"),
                    Catch::Contains("number overflow") && !Catch::Contains("json.exception"));
}

}  // namespace
}  // namespace plumb
