#include "drivers/protocols/reason.h"

#include <algorithm>

namespace plumb {

// Here, not in the header: the compiler makes all of fmt's formatting wherever it is given a buffer
// to write to.
void Reason::Write(fmt::string_view format, fmt::format_args args) noexcept {
  try {
    const auto result = fmt::vformat_to_n(text_.data(), text_.size(), format, args);
    size_ = std::min(result.size, text_.size());
  } catch (...) {  // must not end the cycle: the words without their numbers say enough
    size_ = std::min(format.size(), text_.size());
    std::copy_n(format.data(), size_, text_.data());
  }
}

}  // namespace plumb
