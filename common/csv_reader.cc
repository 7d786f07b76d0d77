#include "common/csv_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <unordered_set>

#include "common/special_numbers.h"

namespace plumb {
namespace {

constexpr std::string_view kUtf8Mark = "\xef\xbb\xbf";
constexpr size_t kLongestQuotation = 40;

bool IsBlank(char c) { return c == ' ' || c == '\t'; }

std::string_view Trimmed(std::string_view text) {
  while (!text.empty() && IsBlank(text.front())) text.remove_prefix(1);
  while (!text.empty() && IsBlank(text.back())) text.remove_suffix(1);
  return text;
}

}  // namespace

std::string Quoted(std::string_view text) {
  std::string quoted = "'";
  for (const char c : text.substr(0, kLongestQuotation)) quoted += c >= ' ' && c <= '~' ? c : '?';
  return quoted + (text.size() > kLongestQuotation ? "...'" : "'");
}

CsvReader::CsvReader(const std::string& file) : file_(file) {
  std::error_code error;
  if (std::filesystem::is_directory(file, error)) throw std::runtime_error(file + ": is a folder");
  stream_.open(file, std::ios::binary);
  if (!stream_) throw std::runtime_error(file + ": cannot be opened");
  if (!ReadLine()) throw std::runtime_error(file + ": is empty");
  Split();
  if (fields_.size() < 2) {
    const bool foreign = line_.find_first_of(";\t") != std::string::npos;
    Fail(foreign ? "columns must be separated by commas"
                 : "is no head of a table: it has no comma");
  }
  names_.assign(fields_.begin(), fields_.end());
  std::unordered_set<std::string_view> seen;
  for (const std::string& name : names_) {
    if (!name.empty() && !seen.insert(name).second)
      Fail("column " + Quoted(name) + " is there twice");
  }
}

int CsvReader::Find(std::string_view name) const {
  const auto found = std::find(names_.begin(), names_.end(), name);
  return found == names_.end() ? -1 : static_cast<int>(found - names_.begin());
}

bool CsvReader::Next() {
  if (!ReadLine()) return false;
  Split();
  if (fields_.size() != names_.size()) {
    Fail(fmt::format("has {} field{} where the head has {}", fields_.size(),
                     fields_.size() == 1 ? "" : "s", names_.size()));
  }
  return true;
}

double CsvReader::Number(int column) const {
  const std::string_view text = Text(column);
  if (text.empty()) return kNaN;
  const auto fail = [&](const char* why) {
    Fail(fmt::format("{} is {}: {}", Quoted(names_[static_cast<size_t>(column)]), Quoted(text),
                     why));
  };
  const char* begin = text.data() + (text.front() == '+' ? 1 : 0);
  const char* end = text.data() + text.size();
  double value = 0;
  const auto [rest, error] = std::from_chars(begin, end, value);
  if (error == std::errc::result_out_of_range) fail("a number too large or too small for a double");
  if (error != std::errc() || rest != end || (begin != text.data() && *begin == '-')) {
    fail("that is no number");
  }
  if (std::isinf(value)) fail("it must be finite, or nan where nothing was observed");
  return value;
}

void CsvReader::Fail(const std::string& what) const {
  throw std::runtime_error(fmt::format("{}:{}: {}", file_, line_number_, what));
}

// The next line that says something, without its end. A file that is no text may have no line ends:
// it is not swallowed whole.
bool CsvReader::ReadLine() {
  std::streambuf& bytes = *stream_.rdbuf();
  constexpr int kEnd = std::char_traits<char>::eof();
  for (int c = 0; c != kEnd;) {
    line_.clear();
    ++line_number_;
    while ((c = bytes.sbumpc()) != kEnd && c != '\n') {
      if (c == 0) Fail("is no text: it has a zero byte");
      if (line_.size() == kLongestLine) Fail("is longer than a megabyte");
      line_.push_back(static_cast<char>(c));
    }
    if (line_number_ == 1 && line_.starts_with(kUtf8Mark)) line_.erase(0, kUtf8Mark.size());
    if (line_.ends_with('\r')) line_.pop_back();
    const std::string_view text = Trimmed(line_);
    if (!text.empty() && text.front() != '#') return true;
  }
  return false;
}

// Fields point into the line; a quoted one's doubled quotes are made single in place.
void CsvReader::Split() {
  fields_.clear();
  for (size_t at = 0;;) {
    while (at < line_.size() && IsBlank(line_[at])) ++at;
    size_t comma;
    if (at < line_.size() && line_[at] == '"') {
      const size_t begin = at + 1;
      size_t end = begin;
      for (++at;; ++at) {
        if (at == line_.size()) Fail("a quotation has no end");
        if (line_[at] == '"' && (at + 1 == line_.size() || line_[at + 1] != '"')) break;
        if (line_[at] == '"') ++at;
        line_[end++] = line_[at];
      }
      fields_.push_back(std::string_view(line_).substr(begin, end - begin));
      comma = std::min(line_.find(',', at), line_.size());
      if (!Trimmed(std::string_view(line_).substr(at + 1, comma - at - 1)).empty()) {
        Fail("something follows a quotation");
      }
    } else {
      comma = std::min(line_.find(',', at), line_.size());
      fields_.push_back(Trimmed(std::string_view(line_).substr(at, comma - at)));
    }
    if (comma == line_.size()) return;
    at = comma + 1;
  }
}

}  // namespace plumb
