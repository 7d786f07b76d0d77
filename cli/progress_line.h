#pragma once

#include <fmt/format.h>
#include <unistd.h>

#include <iostream>
#include <string>

namespace plumb {

/// One line on standard error that is written over, where people look at it; gone when it ends.
class ProgressLine {
 public:
  /// @param speaks false: never shown.
  explicit ProgressLine(bool speaks = true) : shown_(speaks && isatty(STDERR_FILENO)) {}
  ~ProgressLine() {
    if (shown_) std::cerr << "\r\033[K" << std::flush;
  }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// @param share of the work that is done, 0 to 1.
  void Show(const std::string& what, double share) const {
    if (shown_) std::cerr << fmt::format("\r\033[K{} {:3.0f} %", what, 100 * share) << std::flush;
  }

 private:
  bool shown_;
};

}  // namespace plumb
