#include "common/nearest_name.h"

#include <catch2/catch.hpp>

namespace plumb {
namespace {

TEST_CASE("edit distance") {
  CHECK(EditDistance("kitten", "sitting") == 3);
  CHECK(EditDistance("", "abc") == 3);
  CHECK(EditDistance("abc", "abc") == 0);
}

TEST_CASE("the nearest name, the first of several, and of long ones by their beginning") {
  CHECK(NearestName("mass/tigh", {"mass/torso", "mass/thigh", "mass/leg"}) == "mass/thigh");
  CHECK(NearestName("x", {"a", "b"}) == "a");
  CHECK(NearestName(std::string(1'000'000, 'b'), {std::string(300, 'a'), std::string(300, 'b')}) ==
        std::string(300, 'b'));
}

}  // namespace
}  // namespace plumb
