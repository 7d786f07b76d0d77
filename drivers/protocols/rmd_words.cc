// Of rmd.h: the motor's errors in words.

#include "drivers/protocols/rmd.h"

#include <algorithm>

namespace plumb::rmd {
namespace {

struct ErrorWord {
  uint32_t bit;
  std::string_view words;
};
// "System_errorState", section 2.14.3 of the manual.
constexpr ErrorWord kErrorWords[] = {
    {0x0002, "motor stall"},
    {0x0004, "low voltage"},
    {0x0008, "over-voltage"},
    {0x0010, "over-current"},
    {0x0040, "power overrun"},
    {0x0080, "calibration parameters not written"},
    {0x0100, "speeding"},
    {0x1000, "motor over-temperature"},
    {0x2000, "encoder calibration error"},
};

}  // namespace

std::string_view DescribeErrors(uint32_t errors, std::span<char> buffer) noexcept {
  if (errors == 0) return "no error";
  size_t size = 0;
  const auto append = [&](std::string_view words) {
    for (const std::string_view text : {std::string_view(size > 0 ? ", " : ""), words}) {
      const size_t count = std::min(text.size(), buffer.size() - size);
      std::copy_n(text.data(), count, buffer.data() + size);
      size += count;
    }
  };
  for (const ErrorWord& word : kErrorWords) {
    if ((errors & word.bit) != 0) append(word.words);
    errors &= ~word.bit;
  }
  if (errors != 0) append("an unknown error");
  return {buffer.data(), size};
}

}  // namespace plumb::rmd
