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

TEST_CASE("Two go together, each with jobs of its own, and whoever is idle helps") {
  for (const int threads : {1, 2, 3}) {
    Workers workers(threads);
    for (int round = 0; round < 300; ++round) {
      std::atomic<int> first{0}, second{0};
      std::vector<std::atomic<int>> inside(static_cast<size_t>(threads));
      std::atomic<bool> alone{true};
      const auto job = [&](std::atomic<int>& done, int tasks) {
        workers.Run(tasks, [&](int, int worker) {
          if (++inside[static_cast<size_t>(worker)] != 1) alone = false;
          ++done;
          --inside[static_cast<size_t>(worker)];
        });
      };
      // Either may be the longer one.
      const int jobs = round % 7, others = round % 5;
      workers.Together(
          [&] {
            for (int i = 0; i < jobs; ++i) job(first, 4);
          },
          [&] {
            for (int i = 0; i < others; ++i) job(second, 3);
          });
      REQUIRE(first == 4 * jobs);
      REQUIRE(second == 3 * others);
      REQUIRE(alone);
    }
    CHECK_THROWS_WITH(workers.Together([] { throw std::runtime_error("first"); },
                                       [] { throw std::runtime_error("second"); }),
                      "first");
    std::atomic<int> done{0};
    CHECK_THROWS_WITH(workers.Together([&] { workers.Run(4, [&](int, int) { ++done; }); },
                                       [] { throw std::runtime_error("second"); }),
                      "second");
    CHECK(done == 4);
  }
}

TEST_CASE("Workers may be used by another's threads") {
  Workers outer(3);
  std::atomic<int> done{0};
  outer.Run(6, [&](int, int) {
    Workers inner(2);
    inner.Run(5, [&](int, int worker) { done += worker < 2 ? 1 : 1000; });
  });
  CHECK(done == 30);
}

TEST_CASE("The lowest task's exception comes back and the threads live on") {
  Workers workers(3);
  std::atomic<int> done{0};
  for (int round = 0; round < 50; ++round) {
    CHECK_THROWS_WITH(workers.Run(20,
                                  [&](int task, int) {
                                    ++done;
                                    if (task % 7 == 3)
                                      throw std::runtime_error(std::to_string(task));
                                  }),
                      "3");
  }
  CHECK(done == 50 * 20);
  workers.Run(5, [&](int, int) { ++done; });
  CHECK(done == 50 * 20 + 5);
}

}  // namespace
}  // namespace plumb
