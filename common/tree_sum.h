#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace plumb {

/// Sums of many vectors have the same bits whoever adds them up if the order of the additions is
/// fixed. Here it is a binary tree's: the terms [begin, end) are the sum of [begin, middle) and
/// [middle, end), the middle rounded down. Whoever has consecutive terms can add up whole branches
/// alone and need only hand on those. Thread-safe for different values.

/// The terms [begin, end) of a sum, added up.
struct PartialSum {
  int begin, end;
  float* values;
};

/// The fewest branches of the tree over `terms` terms that together are the terms [begin, end), in
/// order: at most 2 log2(terms); one, if the terms are cut into 2, 4, 8... equal parts.
std::vector<std::pair<int, int>> Branches(int terms, int begin, int end);

/// Adds up what together is one branch, in the tree's order. Not empty.
/// @param parts neighbours, each a branch itself. @param first,count the elements to be added up:
/// disjoint ranges may be so by different threads.
/// @return the sum: its values are parts.front().values, overwritten there; other values may be,
/// too.
PartialSum AddUp(std::span<const PartialSum> parts, size_t first, size_t count);

}  // namespace plumb
