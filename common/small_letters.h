#pragma once

#include <string>
#include <string_view>

namespace plumb {

/// A to Z as a to z, and everything else as it is, whatever the locale. Thread-safe.
inline std::string InSmallLetters(std::string_view text) {
  std::string small(text);
  for (char& letter : small) {
    if (letter >= 'A' && letter <= 'Z') letter = static_cast<char>(letter - 'A' + 'a');
  }
  return small;
}

}  // namespace plumb
