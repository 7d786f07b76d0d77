#include "common/nearest_name.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace plumb {

size_t EditDistance(std::string_view a, std::string_view b) {
  std::vector<size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), size_t{0});
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t substituted = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({substituted, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row.back();
}

const std::string& NearestName(std::string_view name, const std::vector<std::string>& names) {
  constexpr size_t kLongest = 200;  // of names from outside: they may be as long as a file
  const std::string* nearest = &names.front();
  size_t least = std::numeric_limits<size_t>::max();
  for (const std::string& candidate : names) {
    const size_t distance =
        EditDistance(name.substr(0, kLongest), std::string_view(candidate).substr(0, kLongest));
    if (distance < least) least = distance, nearest = &candidate;
  }
  return *nearest;
}

}  // namespace plumb
