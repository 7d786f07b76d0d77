#include "common/tree_sum.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "common/random.h"

namespace plumb {
namespace {

constexpr size_t kSize = 37;
using Vectors = std::vector<std::vector<float>>;

/// Terms of very different sizes: the order of additions shows.
Vectors RandomVectors(int count) {
  Random random(3, {static_cast<uint32_t>(count)});
  Vectors terms(static_cast<size_t>(count), std::vector<float>(kSize));
  for (auto& term : terms) {
    for (float& value : term)
      value = static_cast<float>(std::exp(5 * random.Normal()) * random.Uniform(-1, 1));
  }
  return terms;
}

/// The sum when each of `owners` adds up its branches and one adds up those, in pieces of `slice`
/// elements.
std::vector<float> SumOf(Vectors terms, int owners, size_t slice) {
  const int count = static_cast<int>(terms.size());
  std::vector<float> sum;
  for (size_t first = 0; first < kSize; first += slice) {
    const size_t elements = std::min(slice, kSize - first);
    std::vector<PartialSum> branches;
    for (int owner = 0; owner < owners; ++owner) {
      for (const auto& [begin, end] :
           Branches(count, count * owner / owners, count * (owner + 1) / owners)) {
        std::vector<PartialSum> parts;
        for (int i = begin; i < end; ++i)
          parts.push_back({i, i + 1, terms[static_cast<size_t>(i)].data()});
        branches.push_back(AddUp(parts, first, elements));
      }
    }
    const PartialSum whole = AddUp(branches, first, elements);
    CHECK(whole.begin == 0);
    CHECK(whole.end == count);
    sum.insert(sum.end(), whole.values + first, whole.values + first + elements);
  }
  return sum;
}

TEST_CASE("a sum has the same bits whoever has the terms, and however it is sliced") {
  for (const int terms : {1, 2, 3, 7, 8, 20, 64, 100}) {
    const std::vector<float> sum = SumOf(RandomVectors(terms), 1, kSize);
    for (int owners = 2; owners <= 9; ++owners)
      CHECK(SumOf(RandomVectors(terms), owners, kSize) == sum);
    CHECK(SumOf(RandomVectors(terms), 3, 10) == sum);
  }
}

TEST_CASE("the sum is the sum") {
  const Vectors terms = RandomVectors(20);
  const std::vector<float> sum = SumOf(terms, 1, kSize);
  for (size_t i = 0; i < kSize; ++i) {
    double exact = 0, size = 0;
    for (const auto& term : terms) exact += double{term[i]}, size += std::abs(double{term[i]});
    CHECK(std::abs(sum[i] - exact) < 1e-6 * size);
  }
}

TEST_CASE("branches are few, in order, and make up the range") {
  for (const int terms : {1, 5, 8, 64, 77}) {
    for (int begin = 0; begin <= terms; ++begin) {
      for (int end = begin; end <= terms; ++end) {
        int next = begin;
        const auto branches = Branches(terms, begin, end);
        for (const auto& [from, to] : branches) {
          CHECK(from == next);
          CHECK(to > from);
          next = to;
        }
        CHECK(next == end);
        CHECK(branches.size() <= 2 * std::ceil(std::log2(terms)) + 1);
      }
    }
    // Halves, quarters, ... are branches themselves.
    for (int parts = 2; terms % parts == 0; parts *= 2) {
      for (int i = 0; i < parts; ++i)
        CHECK(Branches(terms, terms * i / parts, terms * (i + 1) / parts).size() == 1);
    }
  }
}

}  // namespace
}  // namespace plumb
