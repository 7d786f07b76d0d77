#include "common/progress_line.h"

#include <fmt/format.h>
#include <unistd.h>

namespace plumb {

ProgressLine::ProgressLine(bool speaks, std::ostream& stream)
    : stream_(stream),
      shown_(speaks && isatty(&stream == &std::cout ? STDOUT_FILENO : STDERR_FILENO)) {}

void ProgressLine::Show(const std::string& line) {
  if (!shown_) return;
  stream_ << "\r\033[K" << line << std::flush;
  open_ = true;
}

void ProgressLine::Show(const std::string& what, double share) {
  Show(fmt::format("{} {:3.0f} %", what, 100 * share));
}

void ProgressLine::Clear() {
  if (open_) stream_ << "\r\033[K" << std::flush;
  open_ = false;
}

void ProgressLine::Keep() {
  if (open_) stream_ << "\n";
  open_ = false;
}

}  // namespace plumb
