#pragma once

#include <fmt/format.h>

#include <array>
#include <cstddef>
#include <string_view>

namespace plumb {

/// A cause in words: a line in a fixed buffer, which the cycle can write. Not thread-safe.
class Reason {
 public:
  template <class... Args>
  void Set(fmt::format_string<Args...> format, Args&&... args) noexcept {
    Write(format, fmt::make_format_args(args...));
  }
  void Clear() noexcept { size_ = 0; }
  std::string_view text() const noexcept { return {text_.data(), size_}; }

 private:
  void Write(fmt::string_view format, fmt::format_args args) noexcept;

  std::array<char, 256> text_;
  size_t size_ = 0;
};

}  // namespace plumb
