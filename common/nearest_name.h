#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace plumb {

/// Levenshtein's distance: how many letters are inserted, deleted or replaced to make one of the
/// other. Thread-safe. Time is of the order of the product of the lengths.
size_t EditDistance(std::string_view a, std::string_view b);

/// The name most like another one, for "did you mean"; of several the first. Of long names only the
/// first 200 letters are compared. Thread-safe.
/// @param names not empty. @return one of them.
const std::string& NearestName(std::string_view name, const std::vector<std::string>& names);

}  // namespace plumb
