#include "drivers/protocols/reason.h"

namespace plumb {

// Here, not in the header: the compiler makes all of fmt's formatting wherever it is given a buffer
// to write to.
void Reason::Write(fmt::string_view format, fmt::format_args args) noexcept {
  const auto result = fmt::vformat_to_n(text_.data(), text_.size(), format, args);
  size_ = result.size < text_.size() ? result.size : text_.size();
}

}  // namespace plumb
