#pragma once

#include <string>

namespace plumb {

/// One line on standard error that is written over, where people look at it; gone when it ends. Not
/// thread-safe.
class ProgressLine {
 public:
  /// @param speaks false: never shown.
  explicit ProgressLine(bool speaks = true);
  ~ProgressLine() { Clear(); }
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  /// Whether somebody sees it: standard error is a terminal.
  bool shown() const { return shown_; }
  void Show(const std::string& line) const;
  /// "what  42 %". @param share of the work that is done, 0 to 1.
  void Show(const std::string& what, double share) const;
  /// Makes room for other output.
  void Clear() const;

 private:
  bool shown_;
};

}  // namespace plumb
