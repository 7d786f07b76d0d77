#include "common/tree_sum.h"

#include <algorithm>

namespace plumb {
namespace {

int Middle(int begin, int end) { return begin + (end - begin) / 2; }

void Collect(int branch_begin, int branch_end, int begin, int end,
             std::vector<std::pair<int, int>>& found) {
  if (branch_end <= begin || end <= branch_begin) return;
  if (begin <= branch_begin && branch_end <= end) {
    found.emplace_back(branch_begin, branch_end);
    return;
  }
  const int middle = Middle(branch_begin, branch_end);
  Collect(branch_begin, middle, begin, end, found);
  Collect(middle, branch_end, begin, end, found);
}

}  // namespace

std::vector<std::pair<int, int>> Branches(int terms, int begin, int end) {
  std::vector<std::pair<int, int>> found;
  Collect(0, terms, begin, end, found);
  return found;
}

PartialSum AddUp(std::span<const PartialSum> parts, size_t first, size_t count) {
  if (parts.size() == 1) return parts.front();
  const int middle = Middle(parts.front().begin, parts.back().end);
  const auto right = std::partition_point(
      parts.begin(), parts.end(), [middle](const PartialSum& part) { return part.begin < middle; });
  const auto split = static_cast<size_t>(right - parts.begin());
  const PartialSum left_sum = AddUp(parts.first(split), first, count);
  const PartialSum right_sum = AddUp(parts.subspan(split), first, count);
  float* to = left_sum.values + first;
  const float* from = right_sum.values + first;
  for (size_t i = 0; i < count; ++i) to[i] += from[i];
  return {left_sum.begin, right_sum.end, left_sum.values};
}

}  // namespace plumb
