#include "experiments/results.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <string>

#include "tests/temporary_folder.h"

namespace plumb {
namespace {

Results Open(const std::filesystem::path& file, const std::string& settings = "runs 2") {
  return Results(file, settings, {"task", "way"}, {"n", "error"});
}

void Write(const std::filesystem::path& file, const std::string& text) {
  std::ofstream(file) << text;
}

TEST_CASE("a table is read as it was written, nan included") {
  const TemporaryFolder folder;
  const auto file = folder.path() / "deep" / "table.csv";
  {
    Results results = Open(file);
    results.Add("hop,step", {{1, 0.5}, {2, std::nan("")}});
    results.Add("hop,prior", {{1, 1e-12}});
    CHECK_THROWS_AS(results.Add("hop,step", {}), std::invalid_argument);
  }
  const Results results = Open(file);
  REQUIRE(results.Has("hop,step"));
  CHECK(results.Of("hop,step")[0] == std::vector<double>{1, 0.5});
  CHECK(std::isnan(results.Of("hop,step")[1][1]));
  CHECK(results.Of("hop,prior") == Results::Rows{{1, 1e-12}});
  CHECK(!results.Has("hop,oracle"));
}

TEST_CASE("who makes a result goes on with the numbers that who reads the table has") {
  const TemporaryFolder folder;
  const auto file = folder.path() / "table.csv";
  Results::Rows made;
  {
    Results results = Open(file);
    results.Add("hop,step", {{1. / 3, 2e9 / 7}, {-M_PI * 1e-9, 1e300 / 3}, {INFINITY, 0.1}});
    made = results.Of("hop,step");
  }
  CHECK(made[0][0] == 0.33333333);
  CHECK(Open(file).Of("hop,step") == made);
}

TEST_CASE("a table of something else is not touched") {
  const TemporaryFolder folder;
  const auto file = folder.path() / "table.csv";
  const std::string right = "# runs 2\ntask,way,n,error\n";
  for (const std::string text :
       {"", "x\n", "# runs 2\n", "# runs 2\ntask,way,n\n",
        "# runs 2\ntask,way,n,error\nhop,step,1\n", "# runs 2\ntask,way,n,error\nhop,step,1,2,3\n",
        "# runs 2\ntask,way,n,error\nhop\n", "# runs 2\ntask,way,n,error\nhop,step,1,two\n"}) {
    Write(file, text);
    CHECK_THROWS_WITH(Open(file), Catch::Contains("not a table of this experiment"));
  }
  Write(file, right + "hop,step,1,2\n");
  CHECK(Open(file).Has("hop,step"));
  CHECK_THROWS_WITH(Open(file, "runs 3"), Catch::Contains("was made with 'runs 2', not 'runs 3'"));
}

}  // namespace
}  // namespace plumb
