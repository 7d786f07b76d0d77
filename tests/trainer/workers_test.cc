#include "trainer/workers.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <stdexcept>
#include <vector>

namespace plumb {
namespace {

TEST_CASE("Every task is done exactly once, job after job, with any number of threads") {
  for (const int threads : {1, 2, 5}) {
    Workers workers(threads);
    CHECK(workers.size() == threads);
    for (int job = 0; job < 300; ++job) {
      const int tasks = job % 17;
      std::vector<std::atomic<int>> done(static_cast<size_t>(tasks));
      std::atomic<bool> known{true};
      workers.Run(tasks, [&](int task, int worker) {
        ++done[static_cast<size_t>(task)];
        if (worker < 0 || worker >= threads) known = false;
      });
      for (const auto& count : done) REQUIRE(count == 1);
      REQUIRE(known);
    }
  }
}

TEST_CASE("No two tasks run as the same worker at once") {
  Workers workers(4);
  std::vector<std::atomic<int>> inside(4);
  std::atomic<bool> alone{true};
  workers.Run(500, [&](int, int worker) {
    if (++inside[static_cast<size_t>(worker)] != 1) alone = false;
    --inside[static_cast<size_t>(worker)];
  });
  CHECK(alone);
}

TEST_CASE("The lowest task's exception comes back and the threads live on") {
  Workers workers(3);
  std::atomic<int> done{0};
  for (int round = 0; round < 50; ++round) {
    CHECK_THROWS_WITH(workers.Run(20,
                                  [&](int task, int) {
                                    ++done;
                                    if (task % 7 == 3) throw std::runtime_error(std::to_string(task));
                                  }),
                      "3");
  }
  CHECK(done == 50 * 20);
  workers.Run(5, [&](int, int) { ++done; });
  CHECK(done == 50 * 20 + 5);
}

}  // namespace
}  // namespace plumb
