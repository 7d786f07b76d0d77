#include "common/progress_line.h"

#include <fmt/format.h>
#include <unistd.h>

#include <string_view>

#include "common/outside_text.h"

namespace plumb {
namespace {

constexpr std::string_view kAnew = "\r\033[K";

}  // namespace

ProgressLine::ProgressLine(bool speaks, std::ostream& stream)
    : stream_(stream),
      fd_(&stream == &std::cout ? STDOUT_FILENO : STDERR_FILENO),
      shown_(speaks && isatty(fd_)) {}

// Past the stream, which lets nobody control the terminal.
void ProgressLine::Put(std::string_view text) {
  stream_.flush();
  if (write(fd_, text.data(), text.size()) < 0) shown_ = false;
}

void ProgressLine::Show(const std::string& line) {
  if (!shown_) return;
  Put(std::string(kAnew) + Printable(line));
  open_ = true;
}

void ProgressLine::Show(const std::string& what, double share) {
  Show(fmt::format("{} {:3.0f} %", what, 100 * share));
}

void ProgressLine::Clear() {
  if (open_) Put(kAnew);
  open_ = false;
}

void ProgressLine::Keep() {
  if (open_) stream_ << "\n";
  open_ = false;
}

}  // namespace plumb
