// Of rmd.h: the motor's errors in words.

#include "drivers/protocols/error_words.h"
#include "drivers/protocols/rmd.h"

namespace plumb::rmd {
namespace {

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
  return DescribeBits(errors, kErrorWords, buffer);
}

}  // namespace plumb::rmd
