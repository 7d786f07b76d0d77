#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <string_view>

namespace plumb {

/// What a bit of a drive's error word means.
struct ErrorWord {
  uint32_t mask;
  std::string_view words;
};

/// The errors in words, a comma between them; "no error", and "an unknown error" of bits that the
/// table has not. Cut off where the buffer ends; does not allocate. Thread-safe.
inline std::string_view DescribeBits(uint32_t errors, std::span<const ErrorWord> table,
                                     std::span<char> buffer) noexcept {
  if (errors == 0) return "no error";
  size_t size = 0;
  const auto append = [&](std::string_view words) {
    for (const std::string_view text : {std::string_view(size > 0 ? ", " : ""), words}) {
      const size_t count = std::min(text.size(), buffer.size() - size);
      std::copy_n(text.data(), count, buffer.data() + size);
      size += count;
    }
  };
  for (const ErrorWord& word : table) {
    if ((errors & word.mask) != 0) append(word.words);
    errors &= ~word.mask;
  }
  if (errors != 0) append("an unknown error");
  return {buffer.data(), size};
}

}  // namespace plumb
