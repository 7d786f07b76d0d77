// Jobs of an experiment, by one process and by several ranks.
#include "experiments/jobs.h"

#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <utility>

#include "tests/mpirun.h"
#include "tests/temporary_folder.h"

namespace plumb {
namespace {

std::string Text(const std::filesystem::path& file) {
  std::stringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

/// Five jobs, of which the k-th has k rows; of so many groups, one after the other.
std::vector<Job> FiveJobs(int groups, std::vector<int>* done) {
  std::vector<Job> jobs;
  for (int k = 0; k < 5; ++k) {
    jobs.push_back({std::to_string(k), 1, k * groups / 5, [k, done](const auto& progress) {
                      progress(0.5);
                      done->push_back(k);
                      Results::Rows rows;
                      for (int row = 0; row < k; ++row)
                        rows.push_back({row + 0.1 * k, std::nan("")});
                      return rows;
                    }});
  }
  return jobs;
}

struct Done {
  std::vector<int> jobs;
  std::optional<int> status;
};

Done Work(const std::filesystem::path& file, const Ranks& ranks, int groups = 5) {
  Process process("test", "memq:", "1");
  Results results(file, "test", {"k"}, {"a", "b"}, ranks);
  Done done;
  done.status = RunJobs(process, FiveJobs(groups, &done.jobs), results);
  for (int k = 1; k < 5; ++k) {
    REQUIRE(results.Of(std::to_string(k)).size() == static_cast<size_t>(k));
    CHECK(results.Of(std::to_string(k)).back()[0] == k - 1 + 0.1 * k);
  }
  return done;
}

TEST_CASE("jobs are done in their order, and those that are in the table are not done again") {
  const TemporaryFolder folder;
  const auto file = folder.path() / "table.csv";
  const Done all = Work(file, Ranks::Alone());
  CHECK(all.jobs == std::vector<int>{0, 1, 2, 3, 4});
  CHECK_FALSE(all.status);
  // The first one has no rows, and so leaves no trace.
  CHECK(Work(file, Ranks::Alone()).jobs == std::vector<int>{0});
}

// Run by each of several ranks.
TEST_CASE("jobs of one of several ranks", "[.jobs]") {
  const Ranks ranks;
  const int groups = std::atoi(std::getenv("PLUMBLINE_GROUPS"));
  const Done done = Work(std::getenv("PLUMBLINE_TABLE"), ranks, groups);
  for (const int k : done.jobs) {
    // by turns, or whole groups by turns
    const int turn = groups < ranks.size() ? k : k * groups / 5;
    CHECK(turn % ranks.size() == ranks.rank());
  }
  if (ranks.rank() > 0) CHECK(done.status == 0);
}

TEST_CASE("several ranks take jobs or groups of them in turn, and leave the table of one") {
  if (!HaveMpirun()) return;
  const TemporaryFolder folder;
  Work(folder.path() / "one.csv", Ranks::Alone());
  for (const auto& [ranks, groups] : {std::pair{2, 5}, {3, 5}, {2, 2}, {3, 2}}) {
    const auto file = folder.path() / fmt::format("{}_{}.csv", ranks, groups);
    const Outcome outcome = Shell(fmt::format("PLUMBLINE_GROUPS={} PLUMBLINE_TABLE={} {}", groups,
                                              file.string(), Mpirun(ranks, HiddenTest("jobs"))));
    INFO(outcome.text);
    REQUIRE(outcome.status == 0);
    CHECK(Text(file) == Text(folder.path() / "one.csv"));
  }
}

}  // namespace
}  // namespace plumb
