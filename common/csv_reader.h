#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

namespace plumb {

/// A table of comma-separated values with a head, read strictly and row by row: RFC 4180, but that
/// a field holds no line break; a UTF-8 mark, blank lines and lines that begin with # are skipped.
/// Memory is that of one line. Not thread-safe. All errors are std::runtime_errors that begin with
/// "file:line: ", or "file: " where there is no line.
class CsvReader {
 public:
  static constexpr size_t kLongestLine = size_t{1} << 20;

  /// Reads the head. @throws std::runtime_error if the file cannot be opened, is no text, or has no
  /// head with at least two names, each of them once.
  explicit CsvReader(const std::string& file);
  CsvReader(const CsvReader&) = delete;
  CsvReader& operator=(const CsvReader&) = delete;

  const std::vector<std::string>& names() const { return names_; }
  /// Column of that name, -1 if there is none.
  int Find(std::string_view name) const;

  /// Goes on to the next row. @return false at the end. @throws std::runtime_error if it has too
  /// few or too many fields.
  bool Next();
  /// A field of the row, without blanks around it; valid until Next.
  std::string_view Text(int column) const { return fields_[static_cast<size_t>(column)]; }
  /// The same as a number; NaN if it is "nan" or empty. @throws std::runtime_error if it is
  /// infinite or no number.
  double Number(int column) const;

  /// An error of the present line.
  [[noreturn]] void Fail(const std::string& what) const;

 private:
  bool ReadLine();
  void Split();

  std::string file_;
  std::ifstream stream_;
  std::string line_;
  int64_t line_number_ = 0;
  std::vector<std::string> names_;
  std::vector<std::string_view> fields_;
};

/// Text of unknown origin, for an error message: in quotes, cut short, without control characters.
std::string Quoted(std::string_view text);

}  // namespace plumb
