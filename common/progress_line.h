#pragma once

#include <iostream>
#include <string>
#include <string_view>

namespace plumb {

/// One line on a terminal that is written over; gone when it ends. Where nobody looks (the stream
/// is no terminal) nothing is written. Not thread-safe.
class ProgressLine {
 public:
  /// @param speaks false: never shown. @param stream std::cerr or std::cout.
  explicit ProgressLine(bool speaks = true, std::ostream& stream = std::cerr);
  ~ProgressLine() { Clear(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// Whether somebody may see it.
  bool shown() const { return shown_; }
  void Show(const std::string& line);
  /// "what  42 %". @param share of the work that is done, 0 to 1.
  void Show(const std::string& what, double share);
  /// Makes room for other output.
  void Clear();
  /// Leaves the line as it is: what follows is below it.
  void Keep();

 private:
  void Put(std::string_view text);

  std::ostream& stream_;
  int fd_;
  bool shown_;
  bool open_ = false;  // something stands there
};

}  // namespace plumb
