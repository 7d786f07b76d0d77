#include "common/ranks.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "common/random.h"
#include "tests/mpirun.h"

namespace plumb {
namespace {

std::vector<std::vector<float>> RandomTerms(int count, size_t size) {
  Random random(4, {static_cast<uint32_t>(count)});
  std::vector<std::vector<float>> terms(static_cast<size_t>(count), std::vector<float>(size));
  for (auto& term : terms) {
    for (float& value : term)
      value = static_cast<float>(std::exp(5 * random.Normal()) * random.Uniform(-1, 1));
  }
  return terms;
}

/// The sum of all terms, of which this rank has its own.
std::vector<float> Sum(const Ranks& ranks, int count, size_t size) {
  auto terms = RandomTerms(count, size);
  const std::vector<int> bounds = ranks.Bounds(count);
  const auto rank = static_cast<size_t>(ranks.rank());
  for (int i = 0; i < count; ++i) {
    if (i < bounds[rank] || i >= bounds[rank + 1])
      terms[static_cast<size_t>(i)].assign(size, std::nanf(""));
  }
  std::vector<PartialSum> branches;
  for (const auto& [begin, end] : Branches(count, bounds[rank], bounds[rank + 1])) {
    std::vector<PartialSum> parts;
    for (int i = begin; i < end; ++i)
      parts.push_back({i, i + 1, terms[static_cast<size_t>(i)].data()});
    branches.push_back(AddUp(parts, 0, size));
  }
  std::vector<float> sum(size);
  ranks.TreeSum(count, branches, sum);
  return sum;
}

TEST_CASE("a rank alone has all of it") {
  const Ranks& ranks = Ranks::Alone();
  CHECK(ranks.rank() == 0);
  CHECK(ranks.size() == 1);
  CHECK(ranks.Bounds(7) == std::vector<int>{0, 7});
  const std::byte bytes[] = {std::byte{3}, std::byte{4}};
  CHECK(ranks.Concatenate(bytes) == std::vector<std::byte>(bytes, bytes + 2));
  CHECK(ranks.Collect(7.5) == std::vector<double>{7.5});
  CHECK(ranks.OnThisMachine().size() == 1);
  const auto terms = RandomTerms(2, 3);
  CHECK(Sum(ranks, 2, 3)[1] == terms[0][1] + terms[1][1]);
}

// Run by each of several ranks.
TEST_CASE("ranks exchange what they should", "[.exchange]") {
  const Ranks ranks;
  const int size = ranks.size(), rank = ranks.rank();
  REQUIRE(size == std::atoi(std::getenv("PLUMBLINE_RANKS")));

  for (const int terms : {1, 2, 3, 8, 20, 64}) {
    for (const size_t length : {size_t{1}, size_t{2}, size_t{1001}}) {
      CHECK(Sum(ranks, terms, length) == Sum(Ranks::Alone(), terms, length));
    }
  }

  double number = rank + .5;
  ranks.Broadcast(std::as_writable_bytes(std::span(&number, 1)));
  CHECK(number == .5);

  const std::vector<int> bounds = ranks.Bounds(5);
  CHECK(bounds.front() == 0);
  CHECK(bounds.back() == 5);
  std::vector<double> items(10, -1);  // two doubles each
  for (int i = bounds[static_cast<size_t>(rank)]; i < bounds[static_cast<size_t>(rank) + 1]; ++i) {
    items[static_cast<size_t>(2 * i)] = i;
    items[static_cast<size_t>(2 * i + 1)] = 10 * i;
  }
  ranks.AllGather(items.data(), 2 * sizeof(double), bounds);
  CHECK(items == std::vector<double>{0, 0, 1, 10, 2, 20, 3, 30, 4, 40});

  // Rank 0 has nothing, the others ever more.
  const std::vector<std::byte> mine(static_cast<size_t>(rank), static_cast<std::byte>(rank));
  std::vector<std::byte> expected;
  for (int r = 0; r < size; ++r)
    expected.insert(expected.end(), static_cast<size_t>(r), static_cast<std::byte>(r));
  CHECK(ranks.Concatenate(mine) == expected);

  const std::vector<int> all = ranks.Collect(rank * rank);
  for (int r = 0; r < size; ++r) CHECK(all[static_cast<size_t>(r)] == r * r);

  {
    const Ranks neighbours = ranks.OnThisMachine();
    CHECK(neighbours.size() == size);
    CHECK(neighbours.Collect(rank) == ranks.Collect(rank));
  }
  CHECK(ranks.Collect(rank).back() == size - 1);  // nobody has left
}

TEST_CASE("any number of ranks") {
  if (!HaveMpirun()) return;
  for (int ranks = 1; ranks <= 4; ++ranks) {
    const Outcome outcome = Shell("PLUMBLINE_RANKS=" + std::to_string(ranks) + " " +
                                  Mpirun(ranks, HiddenTest("exchange")));
    INFO(outcome.text);
    CHECK(outcome.status == 0);
  }
}

// Run by each of two ranks.
TEST_CASE("one rank fails while the other waits for it", "[.failure]") {
  const Ranks ranks;
  if (ranks.rank() == 0) throw std::runtime_error("this one is at a loss");
  ranks.Collect(1);
}

TEST_CASE("a rank that fails does not leave the others waiting") {
  if (!HaveMpirun()) return;
  const Outcome outcome = Shell(Mpirun(2, HiddenTest("failure")));
  INFO(outcome.text);
  CHECK(outcome.status != 0);
  CHECK(outcome.status != 124);  // nobody had to stop it
  CHECK(outcome.text.find("this one is at a loss") != std::string::npos);
}

}  // namespace
}  // namespace plumb
