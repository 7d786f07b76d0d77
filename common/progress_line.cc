#include "common/progress_line.h"

#include <fmt/format.h>
#include <unistd.h>

#include <iostream>

namespace plumb {

ProgressLine::ProgressLine(bool speaks) : shown_(speaks && isatty(STDERR_FILENO)) {}

void ProgressLine::Show(const std::string& line) const {
  if (shown_) std::cerr << "\r\033[K" << line << std::flush;
}

void ProgressLine::Show(const std::string& what, double share) const {
  Show(fmt::format("{} {:3.0f} %", what, 100 * share));
}

void ProgressLine::Clear() const {
  if (shown_) std::cerr << "\r\033[K" << std::flush;
}

}  // namespace plumb
